"""Tracers and scenes of the wing: the float64 image, other cameras and vertices, threads, and what dropping frees."""

import gc
import threading
import weakref
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import atra
from atra import light
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.tracer import BvhTracer
from experiments.classification.shafts.eye import EyeTracer
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.shafts.tracer import ClassifiedTracer
from tests.far import AWAY, FAR, NEAR, SEEN_FAR, SEEN_NEAR
from tests.images import assert_no_pixel_wrong, assert_same_bits
from tests.judge.reference import brute_force
from tests.lenses import lens_camera
from tests.light.pictures.test_paths import lit_cornell_box, through
from tests.light.test_far_light import lights
from tests.machine import NATIVE_LANES
from tests.meshes import cornell_box, quads
from tests.packets.test_lens_views import LENSES, PLACED
from tests.rays.test_far_rays import STARTS, WAYS, assert_same_hits
from tests.tracing.stress import Expected, any_of, stress
from tests.tracing.test_look import FLAT, PATH
from tests.tracing.test_properties import EXAMPLES, assert_agree, parallel_views, views
from tests.tracing.test_thread_stress import BATCHES, COMMON, OFFSETS
from tests.tracing.test_threads import CAMERA, CAMERAS, LARGE, MESH, SMALL, Interrupted
from tests.tracing.test_verbs import OTHER, POSED
from tests.tracing.watertight_scenes import ball

SHAFTS = {"cells": 8, "directions": 2, "rays": 4}

TRACERS = {
    "bvh": partial(BvhTracer, threads=1),
    "classified": partial(ClassifiedTracer, threads=1, **SHAFTS),
    "tile shafts": partial(EyeTracer, threads=1),
}
SCENES = {"bvh": partial(BvhScene, threads=1), "shafts": partial(ShaftScene, threads=1, **SHAFTS)}
every_tracer = pytest.mark.parametrize("kind", TRACERS)
every_scene = pytest.mark.parametrize("kind", SCENES)


@EXAMPLES
@given(views() | parallel_views(), st.sampled_from([1, 8]))
def test_our_own_bvh_gives_the_float64_image(view, packet_width):
    with BvhTracer(view.mesh, view.camera, threads=1, packet_width=packet_width) as tracer:
        assert_agree(view, tracer.trace(view.offset), brute_force(view.mesh, view.camera, view.offset))


@pytest.mark.parametrize("packet_width", [1, NATIVE_LANES])
@pytest.mark.parametrize("name", LENSES)
def test_our_own_bvh_sees_through_a_lens_what_the_reference_sees(name, packet_width):
    mesh, camera = cornell_box(), lens_camera(LENSES[name], PLACED)
    with BvhTracer(mesh, camera, threads=1, packet_width=packet_width) as tracer:
        hits = tracer.trace((0.25, 0.625))
    agreement = assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera, (0.25, 0.625)))
    assert agreement.pixels_equal >= 0.999 * agreement.pixels


def test_shafts_of_tiles_refuse_a_lens_when_made_and_when_looking():
    camera = lens_camera(LENSES["folded"], PLACED)
    for use in (lambda: EyeTracer(cornell_box(), camera), lambda: EyeTracer(cornell_box(), PLACED).look(camera)):
        with pytest.raises(atra.InputError, match=r"OpenCVLens\(k1=-0\.6\).*camera\.undistorted\(\)"):
            use()


@pytest.mark.parametrize("axis", range(3))
def test_classified_traces_a_flat_mesh(axis):
    flat = quads([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]])
    mesh = atra.Mesh(np.roll(flat.vertices, axis, axis=1), flat.faces)
    camera = atra.Camera(
        tuple(np.roll((0.5, 0.5, 2.0), axis)), tuple(np.roll((0.5, 0.5, 0.0), axis)), (0.3, 0.5, 0.7), 60, 16, 16
    )  # fmt: skip
    with ClassifiedTracer(mesh, camera, threads=1) as tracer:
        hits = tracer.trace()
    assert 0.1 < hits.hit.mean() < 0.9
    assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera))


@pytest.mark.parametrize(("options", "message"), [
    ({"packet_width": None}, "packet_width is None, expected one of 1, 4, 8, 16$"),
    ({"traversal": "jump"}, "traversal is 'jump', expected one of push, pop"),
])  # fmt: skip
def test_options_refuse_a_value_when_they_are_made(options, message):
    with pytest.raises(atra.InputError, match=message):
        BvhOptions(**options)


@every_tracer
def test_another_camera_is_seen_as_by_a_new_tracer(kind):
    with TRACERS[kind](MESH, CAMERA) as one:
        one.trace()
        for camera in [*PATH.values(), *([FLAT, CAMERA] if kind == "bvh" else [])]:
            if kind == "tile shafts" and camera.fov_y_degrees < 1:
                continue  # refused: its rays merge
            one.look(camera)
            with TRACERS[kind](MESH, camera) as new:
                assert_same_bits(one.trace(), new.trace())


@every_tracer
def test_an_updated_mesh_is_seen_as_by_a_new_tracer_and_other_faces_are_refused(kind):
    with TRACERS[kind](POSED, CAMERA) as new:
        expected = new.trace()
    one = TRACERS[kind](MESH, CAMERA)
    one.trace()
    one.update(POSED)
    assert_same_bits(one.trace(), expected)
    with pytest.raises(atra.InputError, match=r"expected .* as before"):
        one.update(OTHER)
    one.close()
    with pytest.raises(atra.ClosedError, match=f"this {type(one).__name__} is closed; make a new one"):
        one.trace()


@every_scene
def test_a_scene_of_rays_builds_on_first_use_and_takes_other_vertices(kind):
    directions = np.random.default_rng(3).normal(size=(500, 3)).astype(np.float32)
    rays = atra.Rays(np.zeros((500, 3), np.float32) + np.float32([0.1, 1.0, 0.2]), directions)
    one, new = (SCENES[kind](mesh) for mesh in (MESH, POSED))
    before = one.intersect(one.prepare(rays))
    one.update(POSED)
    after, expected = (scene.intersect(scene.prepare(rays)) for scene in (one, new))
    np.testing.assert_array_equal(after.t, expected.t)
    np.testing.assert_array_equal(after.prim_id, expected.prim_id)
    assert (before.t != after.t).any()


@every_tracer
def test_a_frame_is_wholly_that_of_the_camera_that_came_last_before_it(kind):
    with TRACERS[kind](MESH, LARGE) as new:
        expected = new.trace((0.3, 0.6))
    with TRACERS[kind](MESH, CAMERA) as one:
        one.trace()
        Interrupted(one, lambda: one.look(LARGE), lambda: one.look(SMALL))
        hits = one.trace((0.3, 0.6))
        assert hits.camera is LARGE
        assert_same_bits(hits, expected)


def test_arrays_of_another_size_are_not_written_to_when_steps_are_counted():
    with TRACERS["bvh"](MESH, CAMERA) as one:
        image = one.trace()
        one.look(LARGE)
        with pytest.raises(atra.InputError, match="out has an image"):
            one.prepared.count(image)


@pytest.mark.parametrize("make", [
    partial(BvhTracer, MESH, CAMERA), partial(EyeTracer, MESH, CAMERA), partial(BvhScene, MESH),
])  # fmt: skip
def test_dropping_the_last_reference_ends_its_threads(make):
    gc.collect()
    before = set(threading.enumerate())
    one = make(threads=2)
    one.build()
    if isinstance(one, BvhScene):
        one.intersect(one.prepare(atra.Rays(np.zeros((200, 3)), np.ones((200, 3)))))
    else:
        one.trace()
    started, reference = set(threading.enumerate()) - before, weakref.ref(one)
    assert started
    del one
    gc.collect()  # Numba, where it still compiles, leaves cycles
    assert reference() is None
    for thread in started:
        thread.join(30)
        assert not thread.is_alive()


@pytest.mark.slow
@every_tracer
def test_images_of_a_tracer_that_threads_turn_trace_and_close_are_those_of_one_thread(kind):
    def find(camera, offset):
        with TRACERS[kind](MESH, camera) as one:
            return one.trace(offset)

    expected = Expected(find)

    def trace(one, random):
        hits = one.trace(any_of(OFFSETS, random))
        assert_same_bits(hits, expected(hits.camera, hits.offset))

    calls = {"trace": trace, "look": lambda one, random: one.look(any_of(CAMERAS, random)), **COMMON}
    stress(lambda: TRACERS[kind](MESH, CAMERA, threads=2), calls, ("closed", "out has an image"))


@pytest.mark.slow
@every_scene
def test_hits_of_a_scene_of_our_own_that_threads_ask_and_close_are_those_of_one_thread(kind):
    mesh = ball(2)

    def find(number):
        with SCENES[kind](mesh) as one:
            return one.intersect(one.prepare(BATCHES[number]))

    expected = Expected(find)

    def closest(one, random):
        number = int(random.integers(3))
        hits = one.intersect(one.prepare(BATCHES[number]))
        np.testing.assert_array_equal(hits.prim_id, expected(number).prim_id)
        np.testing.assert_array_equal(hits.t, expected(number).t)

    def occluded(one, random):
        number = int(random.integers(3))
        np.testing.assert_array_equal(one.occluded(one.prepare(BATCHES[number])), expected(number).hit)

    calls = {"closest": closest, "occluded": occluded, **COMMON}
    stress(lambda: SCENES[kind](mesh, threads=2), calls, ("closed", "after close"))


@pytest.mark.slow
@pytest.mark.parametrize("make", [BvhScene, ShaftScene])
def test_whatever_traces_the_rays_of_paths_the_picture_has_the_same_bits(make):
    for options in ({}, {"wave_rays": 2048, "jitter": "shared"}, {"lights": "found", "max_depth": 3}):
        (image, rays), (expected, own) = through(partial(make, threads=1), **options), through(None, **options)
        np.testing.assert_array_equal(image, expected)
        assert rays == own
    holes = [light.MetallicRoughness(0.5, 0.5, "blend"), *lit_cornell_box().materials[1:]]
    with pytest.raises(atra.InputError, match=f"{make.__name__} traces no scene with holes, expected none"):
        through(partial(make, threads=1), replace(lit_cornell_box(), materials=holes))


@pytest.mark.parametrize("kind", [BvhScene, ShaftScene])
def test_scenes_of_our_own_trees_hit_a_far_mesh_as_the_near_one(kind):
    ways = WAYS.astype(np.float32)
    with kind(FAR) as far, kind(NEAR) as near:
        prepared = far.prepare(atra.Rays(STARTS + AWAY, ways))
        expected = near.prepare(atra.Rays(STARTS, ways))
        assert_same_hits(far.intersect(prepared), near.intersect(expected))
        np.testing.assert_array_equal(far.occluded(prepared), near.occluded(expected))
        np.testing.assert_array_equal(far.count(prepared.from_root(1))[0], near.count(expected.from_root(1))[0])


def test_paths_traced_by_our_own_tree_are_those_of_the_near_scene():
    images = []
    for mesh, at, seen in ((FAR, AWAY, SEEN_FAR), (NEAR, 0.0, SEEN_NEAR)):
        scene = light.Scene(mesh, lights=lights(at))
        with light.PathRenderer(scene, seen["pinhole"], rays=BvhScene, threads=1, order="waves") as renderer:
            renderer.add(1)
            images.append(renderer.image)
    np.testing.assert_array_equal(*images)
