"""Rays through our own BVH find what they hit, counted or timed, from any camera and in any batch."""

import numpy as np
import pytest
from hypothesis import given

import atra
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.single import BOXES, STEPS
from experiments.classification.options import BvhOptions
from experiments.classification.tracer import BvhTracer
from tests.far import AWAY, FAR, NEAR
from tests.images import assert_equal_images, assert_same_bits
from tests.judge.reference import brute_force
from tests.lenses import lens_camera
from tests.machine import HELD
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera
from tests.packets.test_lens_views import LENSES, PLACED
from tests.raster.test_raster import PARALLEL
from tests.rays.test_far_rays import STARTS, WAYS, assert_same_hits
from tests.tracing.test_look import FLAT, PATH
from tests.tracing.test_properties import EXAMPLES, assert_agree, parallel_views, views
from tests.tracing.test_threads import CAMERA, MESH
from tests.tracing.test_verbs import POSED
from tests.trees.test_trees import MESHES

TRAVERSALS = ("push", "pop")


def trace(mesh, camera, offset=(0.5, 0.5), traversal="push", threads=1, **tracing):
    with BvhTracer(mesh, camera, BvhOptions(traversal=traversal), threads=threads, **tracing) as tracer:
        return tracer.trace(offset)


@pytest.mark.core
@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_all_traversals_give_the_float64_image_to_the_same_bits(traversal):
    shown = [
        (MESHES["random"], atra.Camera(**EYE_AT_ORIGIN, width=41, height=23, fov_y_degrees=fov)) for fov in (20, 150)
    ]
    shown += [(cornell_box(), cornell_camera(41, 23)), (MESHES["random"], PARALLEL)]
    if HELD:
        shown = shown[:-1] if traversal == "pop" else shown[-1:]
    for mesh, camera in shown:
        for offset in ((0.5, 0.5), (0.0, 0.7)):
            hits = trace(mesh, camera, offset, traversal, threads=2)
            assert_equal_images(mesh, camera, hits, brute_force(mesh, camera, offset))
            assert_same_bits(hits, trace(mesh, camera, offset))


@EXAMPLES
@given(views() | parallel_views())
def test_any_view_gives_the_float64_image(view):
    assert_agree(view, trace(view.mesh, view.camera, view.offset), brute_force(view.mesh, view.camera, view.offset))


@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_of_triangles_at_one_depth_the_lowest_is_stored_in_whatever_order_they_are_met(traversal):
    once = cornell_box()
    faces = np.random.default_rng(3).permutation(np.repeat(once.faces, 5, axis=0))
    lowest = {tuple(face): prim_id for prim_id, face in reversed(list(enumerate(faces.tolist())))}
    hits = trace(atra.Mesh(once.vertices, faces), cornell_camera(41, 23), traversal=traversal, ties="any")
    seen = np.unique(hits.prim_id[hits.hit])
    assert len(seen) > 5
    assert [lowest[tuple(faces[prim_id].tolist())] for prim_id in seen] == seen.tolist()


@pytest.mark.parametrize("traversal", TRAVERSALS)
def test_what_is_counted_is_traced_as_what_is_timed(traversal):
    with BvhTracer(cornell_box(), cornell_camera(32, 32), BvhOptions(traversal=traversal), threads=1) as tracer:
        hits = tracer.trace()
        depth, prim_id = np.empty_like(hits.depth), np.empty_like(hits.prim_id)
        counts = tracer.prepared.count((0.5, 0.5), depth, prim_id)
    np.testing.assert_array_equal(depth, hits.depth)
    assert counts[STEPS] > 0
    assert counts[BOXES] == counts[STEPS] if traversal == "pop" else counts[BOXES] > counts[STEPS]


def test_a_mesh_without_area_is_hit_nowhere():
    mesh = atra.Mesh(np.array([(0, 0, 1), (1, 0, 1), (2, 0, 1)]), np.array([[0, 1, 2]]))
    assert not trace(mesh, atra.Camera(**EYE_AT_ORIGIN, width=8, height=8, fov_y_degrees=60)).hit.any()


def test_other_cameras_and_vertices_are_seen_as_by_a_new_tracer():
    with BvhTracer(MESH, CAMERA, threads=1) as tracer:
        for camera in (CAMERA, *PATH.values(), FLAT):
            tracer.look(camera)
            assert_same_bits(tracer.trace(), trace(MESH, camera))
        tracer.update(POSED)
        assert_same_bits(tracer.trace(), trace(POSED, FLAT))


def test_a_camera_that_turns_about_its_eye_keeps_the_bvh():
    with BvhTracer(MESH, CAMERA, threads=1) as tracer:
        tracer.trace()
        before = tracer.prepared
        tracer.look(atra.Camera(CAMERA.eye, np.add(CAMERA.target, (0.1, 0.0, 0.0)), width=16, height=8))
        assert tracer.trace().depth.shape == (8, 16)
        assert tracer.prepared is before


def test_a_lens_is_refused():
    with pytest.raises(atra.InputError, match=r"OpenCVLens\(k1=-0\.6\).*camera\.undistorted\(\)"):
        BvhTracer(cornell_box(), lens_camera(LENSES["folded"], PLACED))


def test_scenes_of_our_own_tree_hit_a_far_mesh_as_the_near_one():
    ways = WAYS.astype(np.float32)
    with BvhScene(FAR, BvhOptions()) as far, BvhScene(NEAR, BvhOptions()) as near:
        prepared = far.prepare(atra.Rays(STARTS + AWAY, ways))
        expected = near.prepare(atra.Rays(STARTS, ways))
        assert_same_hits(far.intersect(prepared), near.intersect(expected))
        np.testing.assert_array_equal(far.occluded(prepared), near.occluded(expected))
        np.testing.assert_array_equal(far.count(prepared)[0], near.count(expected)[0])
