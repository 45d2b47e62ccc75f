"""The surface area cost of a BVH against boxes small enough to do by hand."""

import numpy as np
import pytest

from atra import AlignedTracer, Camera, PixelTracer
from experiments.workloads.build.bvh_cost import BvhCost, bvh_cost, cost_of
from tests.meshes import random_triangles

TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)


def row_of(count, distance):
    """Triangles side by side."""
    places = np.zeros((count, 1, 3), np.float32)
    places[:, 0, 0] = distance * np.arange(count)
    return (TRIANGLE + places).reshape(-1, 3), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def test_a_leaf_of_all_is_entered_by_every_ray_and_apart_from_each_other_by_few():
    assert bvh_cost(*row_of(0, 3.0)) == BvhCost(0.0, 0.0)
    assert bvh_cost(*row_of(1, 3.0)) == BvhCost(0.0, 1.0)
    # Eight boxes of half area 1 as children of one of half area 22.
    apart = bvh_cost(*row_of(8, 3.0))
    assert (apart.boxes_entered, apart.triangles_tested) == pytest.approx((8 / 22, 8 / 22))


@pytest.mark.parametrize("build_quality", ["low", "medium", "high"])
def test_copies_in_one_place_are_entered_by_every_ray_that_enters_one(build_quality):
    vertices, faces = row_of(64, 3.0)
    once = bvh_cost(vertices, faces, build_quality)
    eight_times = bvh_cost(vertices, np.concatenate([faces] * 8), build_quality)
    assert eight_times.triangles_tested > 4 * once.triangles_tested
    assert eight_times.boxes_entered > 2 * once.boxes_entered


def test_a_tracer_tells_the_cost_of_what_it_gave_to_embree_and_none_of_instances():
    mesh, camera = random_triangles(200, seed=1), Camera((0, 0, 4), (0, 0, 0), width=32, height=32)
    with PixelTracer(mesh, camera) as single, AlignedTracer(mesh, camera, (4, 1), culling=False) as copied:
        plain, copies = cost_of(single), cost_of(copied)
        assert plain is not None
        assert copies is not None
        assert copies.triangles_tested > plain.triangles_tested
    with AlignedTracer(mesh, camera, (4, 1), culling=False, geometry="instanced") as instanced:
        assert cost_of(instanced) is None
    assert cost_of(PixelTracer(mesh, camera)) is None


def test_no_node_is_lost_while_another_device_lets_embree_use_two_threads():
    mesh = random_triangles(2000, 0)
    camera = Camera((0, 0, 9), (0, 0, 0), width=8, height=8)
    with PixelTracer(mesh, camera, threads=2):
        costs = [bvh_cost(mesh.vertices, mesh.faces, children=2) for _ in range(20)]
    for cost in costs:
        assert cost.boxes_entered == pytest.approx(costs[0].boxes_entered, rel=1e-12)
        assert cost.triangles_tested == pytest.approx(costs[0].triangles_tested, rel=1e-12)
