"""Options are plain values that state the library's defaults again: here they are held equal to it."""

from dataclasses import fields
from typing import get_type_hints

import pytest

from atra.alignment.alignment import REFERENCES
from atra.alignment.cells import GEOMETRIES
from atra.compiled.instruction_sets import LANE_COUNTS
from atra.embree.scene import BUILD_QUALITIES
from atra.tracing.rays import TILE_ORDERS
from atra.tracing.tracer import TIES
from experiments.classification.bvh import options as bvh
from experiments.classification.classified import ClassifiedOptions
from experiments.classification.own_bvh import BvhOptions
from experiments.classification.shafts.options import ShaftOptions
from experiments.harness import method
from experiments.methods.aligned import AlignedOptions
from experiments.methods.pixel import PixelOptions


def choices(options, name):
    return options.__dataclass_fields__[name].metadata["choices"]


def test_choices_stated_again_are_those_of_the_library():
    assert (method.LANES, method.BUILD_QUALITIES, method.TIES) == (LANE_COUNTS, BUILD_QUALITIES, TIES)
    assert choices(AlignedOptions, "geometry") == GEOMETRIES
    assert choices(AlignedOptions, "reference") == REFERENCES
    assert choices(PixelOptions, "tile_order") == TILE_ORDERS
    assert choices(PixelOptions, "packet_width") == (1, *LANE_COUNTS)


def name_of_shafts(name):
    return "longest" if name == "shaft_list" else name.removeprefix("shaft_")


@pytest.mark.parametrize(("own", "library", "called"), [
    (BvhOptions, bvh.BvhOptions, str), (ClassifiedOptions, ShaftOptions, name_of_shafts),
], ids=["bvh", "classified"])  # fmt: skip
def test_options_stated_again_are_those_of_the_library_but_for_what_the_paper_measured(own, library, called):
    theirs = {one.name: one for one in fields(library) if one.name not in ("threads", "ties")}
    assert {called(one.name) for one in fields(own)} == theirs.keys()
    for one in fields(own):
        other = theirs[called(one.name)]
        assert one.default == (False if one.name == "robust" else other.default), one.name
        assert get_type_hints(own)[one.name] == get_type_hints(library)[other.name], one.name
