"""Points of workload gather: timed beside what gathers the same, and lost or doubled hits counted."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.errors import InputError
from experiments.workloads.gather import CLOSED, GatherOptions, differences
from experiments.workloads.rounds import own_and_baselines, warm_up
from tests.meshes import cornell_box, cornell_camera
from tests.points import planned

pytestmark = pytest.mark.uncovered


def counted(count):
    return atra.CountResult(np.array(count, np.uint32), (0.5, 0.5), cornell_box(), cornell_camera(2, 2))


def test_lost_and_doubled_hits_are_counted_and_do_not_cancel():
    found = differences(counted([[1, 5], [0, 2]]), counted([[2, 4], [0, 2]]), atra.Count())
    assert found == {"hits_in_all": 8, "hits_missing": 1, "hits_too_many": 1, "pixels_different": 2}


def test_a_layer_of_another_triangle_is_a_different_pixel_and_the_same_depth_to_rounding_is_none():
    with atra.PixelTracer(cornell_box(), cornell_camera(8, 8), threads=1) as tracer:
        single = tracer.gather(atra.Layers(2))
    nudged = replace(single, depth=single.depth * np.float32(1 + 1e-7))
    assert differences(nudged, single, atra.Layers(2))["pixels_different"] == 0
    other = single.prim_id.copy()
    other[0, 3, 4] ^= 1
    assert differences(replace(single, prim_id=other), single, atra.Layers(2))["pixels_different"] == 1


def test_what_no_ray_could_gather_is_refused_before_anything_is_measured():
    with pytest.raises(InputError, match="k is 0"):
        GatherOptions("layers", layers=0)
    with pytest.raises(InputError, match="transmittance is 2"):
        GatherOptions("transmittance", factor=2.0)
    with pytest.raises(InputError, match="method=trimesh finds the nearest hit"):
        planned("trimesh", "gather")


def test_a_warm_up_has_something_that_no_copy_shows_and_leaves_few_samples_undecided():
    point = planned("aligned", "gather", (64, 64)).point
    left_out, undecided = [], []

    def gather(tracer):
        tracer.gather(atra.Count())
        left_out.append(tracer.counters.get("triangles_left_out"))
        undecided.append(len(tracer.prepared._all_hits._undecided[1].keys))

    warm_up(point, own_and_baselines(), gather, CLOSED)
    assert left_out[0] > 0
    assert 0 < max(undecided) < 64 * 64 / 4
