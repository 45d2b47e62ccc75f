"""Rays through our own BVH find what they hit, single or in packets, counted or timed."""

import numpy as np
import pytest

import atra
from atra.embree.packets_kernels import TracedImage
from experiments.classification.bvh.single import BOXES, STEPS
from experiments.classification.bvh.tracer import BvhTracer
from tests.images import assert_equal_images, assert_same_bits
from tests.judge.reference import brute_force
from tests.machine import HELD, NATIVE_LANES
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera
from tests.raster.test_raster import PARALLEL
from tests.trees.test_trees import MESHES

QUICK = [(1, "push"), (1, "pop"), (NATIVE_LANES, "push")]
KINDS = [*QUICK, pytest.param(8, "pop", marks=pytest.mark.slow)]  # compiled for each


def trace(mesh, camera, offset=(0.5, 0.5), **options):
    with BvhTracer(mesh, camera, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


@pytest.mark.core
@pytest.mark.parametrize(("packet_width", "traversal"), KINDS)
def test_all_traversals_give_the_float64_image_to_the_same_bits(packet_width, traversal):
    views = [
        (MESHES["random"], atra.Camera(**EYE_AT_ORIGIN, width=41, height=23, fov_y_degrees=fov)) for fov in (20, 150)
    ]
    views += [(cornell_box(), cornell_camera(41, 23)), (MESHES["random"], PARALLEL)]
    if HELD:
        views = views[:-1] if (packet_width == 1) == (traversal == "pop") else views[-1:]
    for mesh, camera in views:
        for offset in ((0.5, 0.5), (0.0, 0.7)):
            options = {"packet_width": packet_width, "traversal": traversal}
            hits = trace(mesh, camera, offset, threads=2, **options)
            assert_equal_images(mesh, camera, hits, brute_force(mesh, camera, offset))
            assert_same_bits(hits, trace(mesh, camera, offset))


@pytest.mark.parametrize(("packet_width", "traversal"), KINDS)
def test_of_triangles_at_one_depth_the_lowest_is_stored_in_whatever_order_they_are_met(packet_width, traversal):
    once = cornell_box()
    faces = np.random.default_rng(3).permutation(np.repeat(once.faces, 5, axis=0))
    lowest = {tuple(face): prim_id for prim_id, face in reversed(list(enumerate(faces.tolist())))}
    mesh = atra.Mesh(once.vertices, faces)
    hits = trace(mesh, cornell_camera(41, 23), packet_width=packet_width, traversal=traversal, ties="any")
    seen = np.unique(hits.prim_id[hits.hit])
    assert len(seen) > 5
    assert [lowest[tuple(faces[prim_id].tolist())] for prim_id in seen] == seen.tolist()


@pytest.mark.parametrize(
    ("packet_width", "traversal"),
    [
        (1, "pop"),
        (NATIVE_LANES, "push"),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1, "push"), (NATIVE_LANES, "pop"))),
    ],
)
def test_what_is_counted_is_traced_as_what_is_timed(packet_width, traversal):
    mesh, camera = cornell_box(), cornell_camera(32, 32)
    with BvhTracer(mesh, camera, threads=1, packet_width=packet_width, traversal=traversal) as tracer:
        hits = tracer.trace()
        image = TracedImage(np.empty_like(hits.depth), np.empty_like(hits.prim_id))
        counts = tracer.prepared.count(image)
    np.testing.assert_array_equal(image.depth, hits.depth)
    assert counts[STEPS] > 0
    assert counts[BOXES] == counts[STEPS] if traversal == "pop" else counts[BOXES] > counts[STEPS]


def test_a_mesh_without_area_is_hit_nowhere():
    mesh = atra.Mesh(np.array([(0, 0, 1), (1, 0, 1), (2, 0, 1)]), np.array([[0, 1, 2]]))
    for packet_width, traversal in QUICK:
        hits = trace(mesh, atra.Camera(**EYE_AT_ORIGIN, width=8, height=8, fov_y_degrees=60),
                     packet_width=packet_width, traversal=traversal)  # fmt: skip
        assert not hits.hit.any()
