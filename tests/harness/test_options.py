"""Options are plain values that state the library's defaults again: here they are held equal to it."""

from dataclasses import dataclass, field

import pytest

from atra.alignment.alignment import REFERENCES
from atra.alignment.cells import GEOMETRIES
from atra.compiled.instruction_sets import LANE_COUNTS
from atra.embree.scene import BUILD_QUALITIES
from atra.errors import InputError
from atra.tracing.rays import TILE_ORDERS
from atra.tracing.tracer import TIES
from experiments.harness import method
from experiments.harness.options import plain_options, typed
from experiments.methods.aligned import AlignedOptions
from experiments.methods.pixel import PixelOptions
from scenes.loading import SceneSource


def choices(options, name):
    return options.__dataclass_fields__[name].metadata["choices"]


def test_choices_stated_again_are_those_of_the_library():
    assert (method.LANES, method.BUILD_QUALITIES, method.TIES) == (LANE_COUNTS, BUILD_QUALITIES, TIES)
    assert choices(AlignedOptions, "geometry") == GEOMETRIES
    assert choices(AlignedOptions, "reference") == REFERENCES
    assert choices(PixelOptions, "tile_order") == TILE_ORDERS
    assert choices(PixelOptions, "packet_width") == (1, *LANE_COUNTS)


@dataclass
class Fields:
    truth: bool = False
    count: int | None = None
    either: int | str = 1
    size: float = 0.5
    text: str = ""
    source: SceneSource = SceneSource.file
    places: list[list[float]] = field(default_factory=list)


@pytest.mark.parametrize(("given", "expected"), [
    ({"truth": True, "count": None}, {"truth": True, "count": None}),
    ({"count": 3, "size": 2, "text": 2.5}, {"count": 3, "size": 2.0, "text": "2.5"}),
    ({"either": 3}, {"either": 3}),
    ({"either": "x"}, {"either": "x"}),
    ({"source": "generated", "places": [[1, 2.5]]}, {"source": SceneSource.generated, "places": [[1.0, 2.5]]}),
])  # fmt: skip
def test_plain_values_become_those_of_their_types_and_come_back(given, expected):
    options = typed(Fields, given)
    assert {name: getattr(options, name) for name in given} == expected
    assert typed(Fields, plain_options(options)) == options


@pytest.mark.parametrize(("given", "told"), [
    ({"truth": 1}, "method.truth is 1, expected true or false"),
    ({"truth": "yes"}, "method.truth is 'yes', expected true or false"),
    ({"count": True}, "method.count is True, expected a whole number or null"),
    ({"count": 2.0}, "method.count is 2.0, expected a whole number or null"),
    ({"either": [1]}, r"method.either is \[1\], expected a whole number or a text"),
    ({"size": "x"}, "method.size is 'x', expected a number"),
    ({"size": None}, "method.size is None, expected a number"),
    ({"source": 1}, "method.source is 1, expected one of procedural, generated, package, directory, file"),
])  # fmt: skip
def test_a_value_of_another_type_is_refused_by_name_with_what_is_allowed(given, told):
    with pytest.raises(InputError, match=told):
        typed(Fields, given, "method.")
