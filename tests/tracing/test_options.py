"""Options of tracers: keyword arguments with defaults, refused when they are given."""

import re
from functools import partial

import pytest

import atra
from tests.machine import NARROW
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA, SPLIT = cornell_box(), cornell_camera(16, 16), (4, 1)
TRACERS = {
    "raster": partial(atra.RasterTracer, MESH, CAMERA),
    "pixel": partial(atra.PixelTracer, MESH, CAMERA),
    "aligned": partial(atra.AlignedTracer, MESH, CAMERA, SPLIT),
    "frames": partial(atra.FramesTracer, MESH, atra.Alignment.of_frames([CAMERA] * 2, atra.Split(*SPLIT, 16, 16))),
    "visible_first": partial(atra.VisibleFirstTracer, MESH, CAMERA, SPLIT),
}


@pytest.mark.parametrize(("make", "options", "message"), [
    ("pixel", {"packet_width": 3}, "packet_width is 3, this machine supports"),
    ("raster", {"threads": 0}, "threads is 0"),
    ("pixel", {"build_quality": "best"}, "build_quality is 'best', expected one of low, medium, high"),
    ("raster", {"ties": "none"}, "ties is 'none', expected one of lowest, any"),
    *(("aligned", {"memory_budget_bytes": bytes_}, rf"budget_bytes is {re.escape(repr(bytes_))}, expected a number")
      for bytes_ in (-1, "1", float("nan"), (1,))),
    ("pixel", {"packet_rows": 3, "packet_width": NARROW}, f"packet_rows is 3, expected one of 1, 2, {NARROW} for pack"),
    ("pixel", {"tile_order": "spiral"}, "tile_order is 'spiral', expected one of blocks, rows, morton"),
    ("aligned", {"robust": 1}, "robust is 1, expected True or False"),
    ("pixel", {"compact": None}, "compact is None, expected True or False"),
    *(("raster", {"lanes": lanes}, f"lanes is {lanes!r}, expected one of 4, 8, 16, or None$")
      for lanes in (3, 8.0, "8", True)),
    ("aligned", {"reference": "last_cell"}, "reference is 'last_cell', expected one of off_axis, first_cell"),
    ("frames", {"geometry": "shared"}, "geometry is 'shared', expected one of copied, instanced"),
    ("aligned", {"geometry": "instanced"}, "culling is on, .*set culling=False"),
])  # fmt: skip
def test_options_refuse_a_value_when_the_tracer_is_made(make, options, message):
    with pytest.raises(atra.InputError, match=message):
        TRACERS[make](**options)


@pytest.mark.parametrize("make", TRACERS.values(), ids=TRACERS)
def test_counters_are_plain_numbers_and_agree_with_the_tracer(make):
    with make(threads=1) as tracer:
        traced = tracer.trace()
        counters = tracer.counters
        assert counters["triangles_traced"] == tracer.triangle_count > 0
        assert counters.get("embree_bytes", 0) == tracer.embree_bytes
        assert {type(value) for value in counters.values()} <= {int, float}
        assert [(hits.mesh, hits.camera) for hits in traced.images] == list(tracer.views)
        assert all(hits.prim_id.shape == (16, 16) for hits in traced.images)


def test_a_method_by_name_traces_an_image_in_one_line():
    with atra.RasterTracer(MESH, CAMERA) as tracer:
        expected = tracer.trace()
    for method, options in (("raster", {}), ("pixel", {}), ("aligned", {"split": SPLIT})):
        assert (atra.trace(MESH, CAMERA, method, **options).prim_id == expected.prim_id).all()
    with pytest.raises(atra.InputError, match="method is 'rays', expected one of raster, pixel, aligned"):
        atra.trace(MESH, CAMERA, "rays")
