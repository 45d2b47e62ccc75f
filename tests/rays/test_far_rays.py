"""Rays at meshes at map coordinates: the hits are those of the same meshes and rays near the world's origin."""

from __future__ import annotations

import numpy as np
import pytest

import atra
from tests.far import AWAY, FAR, NEAR, SEEN_FAR, SEEN_NEAR, boxes

UTM = np.array([512345.67, 4598765.43, 120.25])
RANDOM = np.random.default_rng(5)
STARTS = np.round(RANDOM.uniform(-6.0, 6.0, (4000, 3)) * 2**16) / 2**16
WAYS = RANDOM.normal(size=(4000, 3))
TO_FAR = np.hstack([np.eye(3), AWAY[:, None]])


def assert_same_hits(far, near):
    assert near.hit.sum() > 200
    np.testing.assert_array_equal(far.prim_id, near.prim_id)
    np.testing.assert_array_equal(far.geometry_id, near.geometry_id)
    np.testing.assert_array_equal(far.t, near.t)
    for name in ("u", "v", "normals"):
        np.testing.assert_array_equal(getattr(far, name), getattr(near, name))
    np.testing.assert_allclose(far.points, near.points + AWAY, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("precision", ["exact", "watertight", "fast"])
def test_rays_straight_down_on_a_cube_at_map_coordinates_hit_its_top_where_it_is(precision):
    cube = boxes()  # the first box is a cube from -4 to -3
    mesh = atra.Mesh(cube.vertices[:8] + 4.0 + UTM, cube.faces[:12])
    starts = UTM + np.random.default_rng(0).uniform((-0.5, -0.5, 3.0), (1.5, 1.5, 3.0), (20_000, 3))
    inside = ((starts[:, :2] > UTM[:2]) & (starts[:, :2] < UTM[:2] + 1.0)).all(axis=1)
    sure = (np.abs(starts[:, :2] - UTM[:2]) > 1e-6).all(axis=1) & (np.abs(starts[:, :2] - UTM[:2] - 1) > 1e-6).all(
        axis=1
    )
    with atra.RayScene(mesh, precision=precision) as scene:
        hits = scene.intersect(starts, (0.0, 0.0, -1.0))
        blocked = scene.occluded(starts, (0.0, 0.0, -1.0))
    np.testing.assert_array_equal(hits.hit[sure], inside[sure])
    np.testing.assert_array_equal(blocked[sure], inside[sure])
    np.testing.assert_allclose(hits.t[inside & sure], 2.0, rtol=1e-6)
    np.testing.assert_allclose(hits.points[inside & sure, 2], UTM[2] + 1.0, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("precision", ["exact", "watertight", "fast"])
def test_every_precision_hits_a_far_mesh_as_the_near_one(precision):
    with atra.RayScene(FAR, precision=precision) as far, atra.RayScene(NEAR, precision=precision) as near:
        hits = far.intersect(STARTS + AWAY, WAYS)
        assert_same_hits(hits, near.intersect(STARTS, WAYS))
        assert hits.mesh is FAR
        np.testing.assert_array_equal(hits.rays.origins, STARTS + AWAY)
        given = {"tnear": 0.5, "tfar": 3.0}
        np.testing.assert_array_equal(far.occluded(STARTS + AWAY, WAYS, **given), near.occluded(STARTS, WAYS, **given))


def test_rays_in_float32_are_moved_to_the_mesh_in_float64():
    ways = WAYS.astype(np.float32)
    starts = (np.round(STARTS) + AWAY).astype(np.float32)
    np.testing.assert_array_equal(starts, np.round(STARTS) + AWAY)
    with atra.RayScene(FAR) as far, atra.RayScene(NEAR) as near:
        assert_same_hits(far.intersect(starts, ways), near.intersect(np.round(STARTS), ways))


PLACES = {
    "both far": ([FAR, boxes(AWAY, 20, 2)], None),
    "one moved there": ([NEAR, boxes(AWAY, 20, 2)], [TO_FAR, np.eye(3, 4)]),
    "both moved there": ([NEAR, boxes(0.0, 20, 2)], [TO_FAR, TO_FAR]),
}


@pytest.mark.parametrize("how", PLACES)
def test_several_meshes_share_one_origin_wherever_they_come_from(how):
    meshes, transforms = PLACES[how]
    with (
        atra.RayScene(meshes, transforms=transforms) as far,
        atra.RayScene([NEAR, boxes(0.0, 20, 2)]) as near,
    ):
        assert far.mesh.has_origin
        assert_same_hits(far.intersect(STARTS + AWAY, WAYS), near.intersect(STARTS, WAYS))
        found, expected = far.all_hits(STARTS + AWAY, WAYS), near.all_hits(STARTS, WAYS)
        for name in ("t", "prim_id", "geometry_id", "leaving", "normals"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_a_far_mesh_may_be_moved_to_the_world_s_origin():
    back = np.hstack([np.eye(3), -AWAY[:, None]])
    with atra.RayScene(FAR, transforms=back) as moved, atra.RayScene(NEAR) as near:
        assert not moved.mesh.has_origin
        np.testing.assert_array_equal(moved.intersect(STARTS, WAYS).t, near.intersect(STARTS, WAYS).t)


def test_all_hits_and_reductions_of_a_far_mesh_are_those_of_the_near_one():
    with atra.RayScene(FAR) as far, atra.RayScene(NEAR) as near:
        found, expected = far.all_hits(STARTS + AWAY, WAYS), near.all_hits(STARTS, WAYS)
        assert len(expected) > 1000
        for name in ("ray_splits", "t", "prim_id", "u", "v", "leaving", "normals"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        np.testing.assert_allclose(found.points, expected.points + AWAY, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(far.count(STARTS + AWAY, WAYS), near.count(STARTS, WAYS))
        for what in (atra.Count(), atra.Thickness(), atra.Transmittance(np.full(NEAR.triangle_count, 0.5))):
            np.testing.assert_array_equal(far.gather(what, STARTS + AWAY, WAYS), near.gather(what, STARTS, WAYS))
        layers = far.gather(atra.Layers(2), STARTS + AWAY, WAYS), near.gather(atra.Layers(2), STARTS, WAYS)
        np.testing.assert_array_equal(layers[0].prim_id, layers[1].prim_id)
        np.testing.assert_array_equal(layers[0].t, layers[1].t)


@pytest.mark.parametrize("count", [4000, 70_000], ids=["rays", "cells"])
@pytest.mark.parametrize("method", ["parity", "winding"])
def test_points_lie_inside_a_far_mesh_as_inside_the_near_one(count, method):
    points = np.round(np.random.default_rng(6).uniform(-5.0, 5.0, (count, 3)) * 2**16 + 0.5) / 2**16
    with atra.RayScene(FAR) as far, atra.RayScene(NEAR) as near:
        expected = near.contains(points, method=method)
        assert 0.01 < expected.mean() < 0.9
        np.testing.assert_array_equal(far.contains(points + AWAY, method=method), expected)


def test_chosen_faces_of_a_far_mesh_are_met_as_those_of_the_near_one():
    faces = np.arange(NEAR.triangle_count) % 24 < 12
    with atra.RayScene(FAR, faces=faces) as far, atra.RayScene(NEAR, faces=faces) as near:
        assert_same_hits(far.intersect(STARTS + AWAY, WAYS), near.intersect(STARTS, WAYS))
        thick = far.gather(atra.Thickness(), STARTS + AWAY, WAYS), near.gather(atra.Thickness(), STARTS, WAYS)
        np.testing.assert_array_equal(*thick)


@pytest.mark.parametrize("precision", ["exact", "watertight"])
def test_update_brings_a_scene_from_one_origin_to_another(precision):
    with atra.RayScene(NEAR, precision=precision) as scene:
        near = scene.intersect(STARTS, WAYS)
        scene.update(FAR)
        assert_same_hits(scene.intersect(STARTS + AWAY, WAYS), near)
        scene.update(NEAR)
        np.testing.assert_array_equal(scene.intersect(STARTS, WAYS).t, near.t)


def test_rays_of_a_camera_meet_a_far_mesh_where_its_image_shows_it():
    camera = SEEN_FAR["pinhole"]
    with atra.RayScene(FAR) as scene, atra.RasterTracer(FAR, camera) as tracer:
        hits, image = scene.intersect(*camera.rays_world()), tracer.trace()
    same = hits.prim_id == image.prim_id
    assert image.hit.sum() > 100
    assert same.mean() > 0.995  # float64 rounds directions in the world, so edges may differ
    np.testing.assert_allclose(hits.points[same & image.hit], image.points[same & image.hit], rtol=0.0, atol=1e-5)


def test_visible_points_and_face_counts_of_a_far_mesh_are_those_of_the_near_one():
    points = NEAR.vertices[::3].astype(np.float64)
    views = [name for name in SEEN_NEAR if name != "panorama"]
    far = atra.visible_points(FAR, points + AWAY, [SEEN_FAR[name] for name in views])
    near = atra.visible_points(NEAR, points, [SEEN_NEAR[name] for name in views])
    assert 0.05 < near.mean() < 0.95
    np.testing.assert_array_equal(far, near)
    counts = [
        atra.face_counts(mesh, [seen[name] for name in views], angle=True, distance=True)
        for mesh, seen in ((FAR, SEEN_FAR), (NEAR, SEEN_NEAR))
    ]
    for name in ("view_splits", "prim_id", "pixels", "angle", "distance"):
        np.testing.assert_array_equal(getattr(counts[0], name), getattr(counts[1], name))
