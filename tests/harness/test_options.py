"""Options are plain values that state the library's defaults again: here they are held equal to it."""

from atra.alignment.alignment import REFERENCES
from atra.alignment.cells import GEOMETRIES
from atra.compiled.instruction_sets import LANE_COUNTS
from atra.embree.scene import BUILD_QUALITIES
from atra.tracing.rays import TILE_ORDERS
from atra.tracing.tracer import TIES
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
