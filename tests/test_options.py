"""Options: one value a tracer, fields of it by name, and everything refused that a tracer does not have."""

import re
from dataclasses import fields, replace
from functools import partial

import pytest

import atra
from atra.tracing.base import EmbreeTracer
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA, SPLIT = cornell_box(), cornell_camera(16, 16), (4, 1)
TRACERS = {
    "pixel": partial(atra.PixelTracer, MESH, CAMERA),
    "aligned": partial(atra.AlignedTracer, MESH, CAMERA, SPLIT),
    "frames": partial(atra.FramesTracer, MESH, atra.Alignment.of_frames([CAMERA] * 2, atra.Split(*SPLIT, 16, 16))),
    "visible_first": partial(atra.VisibleFirstTracer, MESH, CAMERA, SPLIT),
    "tiles": partial(atra.TiledTracer, MESH, CAMERA, SPLIT),
}
every_tracer = pytest.mark.parametrize("make", TRACERS.values(), ids=TRACERS)


@every_tracer
def test_options_and_changes_of_them_are_one_value(make):
    kind: type[atra.Options] = make().options_type
    assert make().options == make(kind()).options == make(None).options == kind()
    given = kind(packet_width=1, threads=1, build_quality="low", ties="any")
    assert make(given).options == given
    changed = make(given, threads=2, ties="lowest")
    assert changed.options == replace(given, threads=2, ties="lowest")
    assert (changed.threads, changed.packet_width) == (2, 1)


@every_tracer
def test_an_unknown_option_is_refused_with_those_there_are(make):
    tracer: EmbreeTracer = make()
    names = ", ".join(field.name for field in fields(tracer.options_type))
    name = type(tracer).__name__
    with pytest.raises(TypeError, match=f"{name} has no option 'packets'; its options are {names}$"):
        make(packets=8)
    with pytest.raises(TypeError, match=f"options of {name} are 8, expected {tracer.options_type.__name__}"):
        make(8)


def test_what_a_tracer_has_not_it_does_not_take():
    for make, option in (("pixel", "memory_budget_bytes"), ("tiles", "packet_rows"), ("visible_first", "culling")):
        with pytest.raises(TypeError, match=f"no option '{option}'"):
            TRACERS[make](**{option: 1})
    with pytest.raises(TypeError, match=r"options of AlignedTracer are CellOptions.*expected AlignedOptions"):
        TRACERS["aligned"](atra.CellOptions())
    assert TRACERS["tiles"](atra.AlignedOptions(threads=1)).threads == 1


@pytest.mark.parametrize(("kind", "options", "message"), [
    (atra.Options, {"packet_width": 3}, "packet_width is 3, this machine supports"),
    (atra.Options, {"threads": 0}, "threads is 0"),
    (atra.Options, {"build_quality": "best"}, "build_quality is 'best', expected one of low, medium, high"),
    (atra.Options, {"ties": "none"}, "ties is 'none', expected one of lowest, any"),
    *((atra.CellOptions, {"memory_budget_bytes": bytes_}, rf"budget_bytes is {re.escape(repr(bytes_))}, expected a num")
      for bytes_ in (-1, "1", float("nan"), (1,))),
    (atra.PixelOptions, {"packet_rows": 3, "packet_width": 4}, "packet_rows is 3, expected one of 1, 2, 4 for packets"),
    (atra.PixelOptions, {"tile_order": "spiral"}, "tile_order is 'spiral', expected one of blocks, rows, morton"),
    (atra.AlignedOptions, {"geometry": "shared"}, "geometry is 'shared', expected one of copied, instanced"),
    (atra.AlignedOptions, {"geometry": "instanced"}, "culling is on, .*set culling=False"),
])  # fmt: skip
def test_options_refuse_a_value_when_they_are_made(kind, options, message):
    with pytest.raises(atra.InputError, match=message):
        kind(**options)
    with pytest.raises(atra.InputError, match=message):
        replace((atra.PixelOptions if kind is atra.PixelOptions else atra.AlignedOptions)(), **options)


@every_tracer
def test_counters_are_plain_numbers_and_agree_with_the_tracer(make):
    with make(threads=1) as tracer:
        traced = tracer.trace()
        counters = tracer.counters
        assert counters["triangles_traced"] == tracer.triangle_count > 0
        assert counters["embree_bytes"] == tracer.embree_bytes > 0
        assert {type(value) for value in counters.values()} <= {int, float}
        assert [(hits.mesh, hits.camera) for hits in traced.images] == list(tracer.views)
        assert all(hits.prim_id.shape == (16, 16) for hits in traced.images)
