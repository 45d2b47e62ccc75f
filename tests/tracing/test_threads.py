"""Calls of several threads in any order: each sees one camera completely, and after `close` there is a clear error."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from atra.light import Baker, Scene
from tests.images import assert_same_bits, make_tracer
from tests.meshes import cornell_box, cornell_camera

MESH, CAMERA = cornell_box(), cornell_camera(64, 48)
SMALL = replace(CAMERA, width=32, height=16, eye=tuple(np.add(CAMERA.eye, (0.1, -0.1, 0.1)).tolist()))
LARGE = replace(CAMERA, width=96, height=80, target=tuple(np.add(CAMERA.target, (0.2, 0.1, 0.0)).tolist()))
CAMERAS = (CAMERA, SMALL, LARGE)


def make(camera, **options):
    """The lock is the tracer's, whatever its method."""
    return make_tracer("aligned", MESH, camera, (16, 1), **options)


class Interrupted:
    """A tracer's lock, around which other threads always come first: `works` are done one after the other, each when
    the lock was about to be taken, or was just released."""

    def __init__(self, one, *works):
        self._lock, self._works, self._depth = one._lock, list(works), 0
        one._lock = self

    def _let_others(self):
        if self._depth == 0 and self._works:
            self._depth = 1  # what they call takes the lock, too
            self._works.pop(0)()
            self._depth = 0

    def __enter__(self):
        self._let_others()
        self._depth += 1
        self._lock.__enter__()

    def __exit__(self, kind, error, trace):
        self._lock.__exit__(kind, error, trace)
        self._depth -= 1
        self._let_others()


def test_a_frame_is_wholly_that_of_the_camera_that_came_last_before_it():
    with make(LARGE) as new:
        expected = new.trace((0.3, 0.6))
    with make(CAMERA) as one:
        one.trace()
        Interrupted(one, lambda: one.look(LARGE), lambda: one.look(SMALL))
        hits = one.trace((0.3, 0.6))
        assert hits.camera is LARGE
        assert_same_bits(hits, expected)
        assert one.camera is SMALL


def test_all_hits_are_wholly_those_of_the_camera_that_came_last_before():
    with make(LARGE) as new:
        expected = new.gather(atra.Count())
    with make(CAMERA) as one:
        Interrupted(one, lambda: one.look(LARGE), lambda: one.look(SMALL))
        counts = one.gather(atra.Count())
        assert counts.camera is LARGE
        np.testing.assert_array_equal(counts.count, expected.count)


def test_an_earlier_result_is_refused_where_it_has_the_size_of_another_camera():
    with make(CAMERA) as one:
        earlier = one.trace()
        Interrupted(one, lambda: one.look(LARGE))
        with pytest.raises(atra.InputError, match="out has an image"):
            one.trace(out=earlier)


FRAMES = atra.Alignment.of_frames([CAMERA, CAMERA], atra.Split(16, 1, 64, 48))
RAYS = (atra.Rays(np.zeros((1, 3)), np.ones((1, 3))),)
ALL = {"trace": (), "build": (), "look": (SMALL,), "update": (MESH,)}
CALLS = {
    "tracer": (partial(make, CAMERA), ALL | {"gather": (atra.Count(),)}),
    "frames": (lambda: atra.FramesTracer(MESH, FRAMES, threads=1), {"trace": (), "build": ()}),
    "rays": (
        lambda: atra.RayScene(MESH, threads=1),
        {"intersect": RAYS, "occluded": RAYS, "all_hits": RAYS, "count": RAYS, "build": (), "update": (MESH,)},
    ),
}


@pytest.mark.parametrize(("kind", "call"), [(kind, call) for kind, (_, calls) in CALLS.items() for call in calls])
def test_a_call_that_another_thread_closes_before_ends_in_a_clear_error(kind, call):
    make_one, calls = CALLS[kind]
    with make_one() as one:
        Interrupted(one, one.close)
        with pytest.raises(atra.ClosedError, match="closed"):
            getattr(one, call)(*calls[call])
        assert one.embree_bytes == 0


LAMPS = tuple(light.Sun((x, -1, -0.2)) for x in (0.1, 0.4))


def picture(camera):
    with light.HybridRenderer(light.Scene(MESH, lights=LAMPS), camera, threads=1) as renderer:
        renderer.add()
        return renderer.image


def test_samples_are_wholly_those_of_the_camera_that_came_last_before_them():
    with light.HybridRenderer(light.Scene(MESH, lights=LAMPS), CAMERA, threads=1) as renderer:
        Interrupted(renderer, lambda: renderer.look(LARGE), lambda: None)
        renderer.add()
        np.testing.assert_array_equal(renderer.image, picture(LARGE))


def test_a_light_that_another_thread_takes_away_is_named():
    with light.HybridRenderer(light.Scene(MESH, lights=LAMPS), CAMERA, threads=1) as renderer:
        renderer.add()
        fewer = light.Scene(MESH, lights=LAMPS[:1])
        Interrupted(renderer, lambda: renderer.update(scene=fewer))
        with pytest.raises(atra.InputError, match="light is 1, but the scene has 1"):
            renderer.lit(1)


def test_a_closed_renderer_changes_no_more_but_hands_out_its_picture():
    with light.HybridRenderer(light.Scene(MESH, lights=LAMPS), CAMERA, threads=1) as renderer:
        renderer.add()
    assert renderer.image.shape == (48, 64, 3)
    for call in (lambda: renderer.look(SMALL), renderer.restart, renderer.add):
        with pytest.raises(atra.ClosedError, match="closed"):
            call()


DARK, BRIGHT = (Scene.plain(MESH, lights=[light.Sun((0.1, -1, -0.2), power=power)]) for power in (1.0, 3.0))
BAKE = {"size": 16, "threads": 1}


@pytest.mark.parametrize("samples", [2, 3])
def test_a_map_is_wholly_of_the_scene_that_came_last_before_it_was_asked_for_or_sampled(samples):
    with Baker(BRIGHT, **BAKE) as baker:
        baker.add(samples)
        expected = baker.maps
    with Baker(DARK, **BAKE) as baker:
        if samples == 3:
            Interrupted(baker, lambda: baker.update(BRIGHT), lambda: None)
            assert baker.add(3)
        else:
            baker.add(3)
            Interrupted(baker, lambda: (baker.update(BRIGHT), baker.add(2)), lambda: baker.update(DARK))
        found = baker.maps
    np.testing.assert_array_equal(found.samples, expected.samples)
    np.testing.assert_array_equal(found.direct, expected.direct)


@pytest.mark.parametrize("call", ["add", "advance", "update", "look", "probes"])
def test_a_baker_that_another_thread_closes_before_says_so_but_hands_out_its_map(call):
    scene = Scene.plain(MESH)
    with Baker(scene, size=16, threads=1) as baker:
        baker.add()
        arguments = {"advance": (3,), "update": (scene,), "look": (CAMERA,), "probes": ([(0, 0, 0)],)}.get(call, ())
        Interrupted(baker, baker.close)
        with pytest.raises(atra.ClosedError, match="closed"):
            getattr(baker, call)(*arguments)
        assert (baker.maps.samples == 1).all()
