"""Four threads that call one tracer or scene in any order: every result is that of a single thread."""

import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import atra
from tests.images import assert_same_bits
from tests.tracing.stress import Expected, any_of, pose, rebuild, stress
from tests.tracing.test_look import KINDS, PARALLEL, tracer
from tests.tracing.test_threads import CAMERA, CAMERAS, MESH, SMALL
from tests.tracing.watertight_scenes import ball

OFFSETS = ((0.5, 0.5), (0.25, 0.75))
COMMON = {"build": rebuild, "update": pose, "counters": lambda one, random: one.counters}
"""Calls of tracers and scenes alike."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_images_of_a_tracer_that_threads_turn_trace_and_close_are_those_of_one_thread(kind):
    def find(camera, offset):
        with tracer(kind, camera) as one:
            return one.trace(offset), one.gather(atra.Count(), offset).count if kind in PARALLEL else None

    expected, earlier = Expected(find), threading.local()

    def trace(one, random):
        out = getattr(earlier, "out", None) if random.random() < 0.5 else None
        hits = one.trace(any_of(OFFSETS, random), out)
        assert_same_bits(hits, expected(hits.camera, hits.offset)[0])
        earlier.out = hits

    def gather(one, random):
        counts = one.gather(atra.Count(), any_of(OFFSETS, random))
        np.testing.assert_array_equal(counts.count, expected(counts.camera, counts.offset)[1])

    def counters(one, random):
        assert one.counters["triangles_traced"] >= 0

    calls = {
        "trace": trace,
        "look": lambda one, random: one.look(any_of(CAMERAS, random)),
        "build": rebuild,
        "update": pose,
        "counters": counters,
    }
    refusals = "closed", "out has an image"  # of another camera's size
    stress(partial(tracer, kind, CAMERA, threads=2), calls | ({"gather": gather} if kind in PARALLEL else {}), refusals)


@pytest.mark.slow
def test_frames_of_a_tracer_that_threads_trace_and_close_are_those_of_one_thread():
    near = replace(CAMERA, eye=tuple(np.add(CAMERA.eye, (0.02, 0.01, 0.0)).tolist()))
    alignment = atra.Alignment.of_frames([CAMERA, near], atra.Split(16, 1, 64, 48))
    earlier = threading.local()

    def find(offset):
        with atra.FramesTracer(MESH, alignment, threads=1) as one:
            return one.trace(offset)

    expected = Expected(find)

    def trace(one, random):
        frames = one.trace(any_of(OFFSETS, random), getattr(earlier, "out", None) if random.random() < 0.5 else None)
        assert_same_bits(frames, expected(frames.offset))
        earlier.out = frames

    def look(one, random):
        with pytest.raises((atra.InputError, atra.ClosedError), match=r"cannot look through|closed"):
            one.look(SMALL)

    calls = {"trace": trace, "look": look, **COMMON}
    stress(lambda: atra.FramesTracer(MESH, alignment, threads=2), calls)


BATCHES = tuple(
    atra.Rays(random.uniform(-0.3, 0.3, (count, 3)), random.normal(size=(count, 3)), tfar=random.uniform(0, 4, count))
    for random, count in ((np.random.default_rng(count), count) for count in (1, 700, 5000))
)


@pytest.mark.slow
def test_hits_of_a_ray_scene_that_threads_ask_and_close_are_those_of_one_thread():
    mesh, earlier = ball(3), threading.local()

    def find(number, coherent):
        with atra.RayScene(mesh, threads=1) as one:
            rays = BATCHES[number]
            return one.intersect(rays, coherent=coherent), one.occluded(rays, coherent=coherent)

    expected = Expected(find)

    def closest(one, random):
        number, coherent = int(random.integers(3)), any_of((None, False, True), random)
        out = getattr(earlier, "out", None) if random.random() < 0.5 else None
        hits = one.intersect(BATCHES[number], coherent=coherent, out=out)
        np.testing.assert_array_equal(hits.prim_id, expected(number, coherent)[0].prim_id)
        np.testing.assert_array_equal(hits.t, expected(number, coherent)[0].t)
        earlier.out = hits

    def occluded(one, random):
        number, coherent = int(random.integers(3)), any_of((None, False, True), random)
        found = one.occluded(BATCHES[number], coherent=coherent)
        np.testing.assert_array_equal(found, expected(number, coherent)[1])

    def held(one, random):
        assert one.embree_bytes >= 0

    calls = {"closest": closest, "occluded": occluded, "build": rebuild, "update": pose, "bytes": held}
    stress(lambda: atra.RayScene(mesh, threads=2), calls, ("closed", "out.t is"))
