"""Options: one value a tracer, fields of it by name, and everything refused that a tracer does not have."""

import inspect
import re
from dataclasses import fields, replace
from functools import partial
from importlib import import_module
from pkgutil import walk_packages
from typing import get_args, get_type_hints, is_typeddict

import pytest

import atra
from tests.machine import NARROW
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA, SPLIT = cornell_box(), cornell_camera(16, 16), (4, 1)
TRACERS = {
    "pixel": partial(atra.PixelTracer, MESH, CAMERA),
    "aligned": partial(atra.AlignedTracer, MESH, CAMERA, SPLIT),
    "frames": partial(atra.FramesTracer, MESH, atra.Alignment.of_frames([CAMERA] * 2, atra.Split(*SPLIT, 16, 16))),
    "visible_first": partial(atra.VisibleFirstTracer, MESH, CAMERA, SPLIT),
}
every_tracer = pytest.mark.parametrize("make", TRACERS.values(), ids=TRACERS)


@every_tracer
def test_options_by_name_are_those_of_the_tracer_s_type(make):
    kind = make().options_type
    assert make().options == kind()
    given = kind(packet_width=1, threads=1, build_quality="low", ties="any")
    made = make(**given.keywords())
    assert made.options == given
    assert (made.threads, made.packet_width) == (1, 1)


@every_tracer
def test_an_unknown_option_is_refused_with_those_there_are(make):
    tracer = make()
    names = ", ".join(field.name for field in fields(tracer.options_type))
    with pytest.raises(TypeError, match=f"{type(tracer).__name__} has no option 'packets'; its options are {names}$"):
        make(packets=8)


def test_what_a_tracer_has_not_it_does_not_take():
    for make, option in (
        ("pixel", "memory_budget_bytes"), ("visible_first", "culling"),
        ("frames", "reference"),
    ):  # fmt: skip
        with pytest.raises(TypeError, match=f"no option '{option}'"):
            TRACERS[make](**{option: 1})


def methods_with_keywords():
    """Every constructor and public method of the library's classes that takes `**keywords`, by its name."""
    found = {}
    for info in walk_packages(atra.__path__, "atra."):
        # Embree's room hands on what a device takes, to no user; stand-ins have the interface of other libraries.
        if info.name.startswith(("atra.embree.", "atra.compat.")):
            continue
        classes = [one for one in vars(import_module(info.name)).values() if inspect.isclass(one)]
        methods = [one for kind in classes if kind.__module__ == info.name for one in vars(kind).values()]
        for method in filter(inspect.isfunction, methods):
            is_public = not re.search(r"(^|\.)_(?!_init__)", method.__qualname__) and not hasattr(method, "__wrapped__")
            if is_public and method.__code__.co_flags & inspect.CO_VARKEYWORDS:
                found[method.__qualname__] = method
    return found


METHODS = methods_with_keywords()


def test_every_tracer_renderer_and_baker_takes_keywords_that_are_known():
    kinds = {
        "AlignedTracer", "Baker", "FramesTracer", "HybridRenderer", "PathRenderer", "PixelTracer", "RasterTracer",
        "RayScene", "VisibleFirstTracer",
    }  # fmt: skip
    updates = {"HybridRenderer.update", "PathRenderer.update", "Renderer.update"}
    assert set(METHODS) == {f"{kind}.__init__" for kind in kinds} | updates


@pytest.mark.parametrize("name", METHODS)
def test_a_signature_lists_the_names_and_types_that_type_checkers_know(name):
    method = METHODS[name]
    code = method.__code__
    others = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    (keywords,) = get_args(get_type_hints(method)[code.co_varnames[len(others)]])
    assert is_typeddict(keywords)
    assert not keywords.__required_keys__
    listed = {one.name: one.annotation for one in inspect.signature(method).parameters.values()}
    assert list(listed)[: len(others)] == list(others)
    assert {name: kind for name, kind in listed.items() if name not in others} == get_type_hints(keywords)


def test_help_shows_options_with_their_defaults():
    text = str(inspect.signature(atra.PixelTracer))
    assert "packet_width: int | None = None" in text
    assert "tile_order: str = 'blocks'" in text
    assert "reference: str = 'off_axis'" in str(inspect.signature(atra.AlignedTracer))


@pytest.mark.parametrize(("kind", "options", "message"), [
    (atra.Options, {"packet_width": 3}, "packet_width is 3, this machine supports"),
    (atra.Options, {"threads": 0}, "threads is 0"),
    (atra.Options, {"build_quality": "best"}, "build_quality is 'best', expected one of low, medium, high"),
    (atra.Options, {"ties": "none"}, "ties is 'none', expected one of lowest, any"),
    *((atra.CellOptions, {"memory_budget_bytes": bytes_}, rf"budget_bytes is {re.escape(repr(bytes_))}, expected a num")
      for bytes_ in (-1, "1", float("nan"), (1,))),
    (atra.PixelOptions, {"packet_rows": 3, "packet_width": NARROW},
     f"packet_rows is 3, expected one of 1, 2, {NARROW} for packets"),
    (atra.PixelOptions, {"tile_order": "spiral"}, "tile_order is 'spiral', expected one of blocks, rows, morton"),
    (atra.Options, {"robust": 1}, "robust is 1, expected True or False"),
    (atra.PixelOptions, {"compact": None}, "compact is None, expected True or False"),
    *((atra.RasterOptions, {"lanes": lanes}, f"lanes is {lanes!r}, expected one of 4, 8, 16, or None$")
      for lanes in (3, 8.0, "8", True)),
    (atra.AlignedOptions, {"reference": "last_cell"}, "reference is 'last_cell', expected one of off_axis, first_cell"),
    (atra.AlignedOptions, {"geometry": "shared"}, "geometry is 'shared', expected one of copied, instanced"),
    (atra.AlignedOptions, {"geometry": "instanced"}, "culling is on, .*set culling=False"),
])  # fmt: skip
def test_options_refuse_a_value_when_they_are_made(kind, options, message):
    with pytest.raises(atra.InputError, match=message):
        kind(**options)
    with pytest.raises(atra.InputError, match=message):
        replace((atra.AlignedOptions if issubclass(atra.AlignedOptions, kind) else kind)(), **options)


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
