"""Four threads that call one tracer or scene in any order: every result is that of a single thread."""

import threading
from functools import partial

import numpy as np
import pytest

import atra
from tests.images import assert_same_bits
from tests.tracing.stress import Expected, any_of, pose, rebuild, stress
from tests.tracing.test_look import KINDS, PARALLEL, tracer
from tests.tracing.test_threads import CAMERA, CAMERAS

OFFSETS = ((0.5, 0.5), (0.25, 0.75))


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
