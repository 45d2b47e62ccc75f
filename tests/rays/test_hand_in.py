"""Rays and meshes as people hand them to a ray scene, and what a scene keeps through updates and failures."""

import threading

import numpy as np
import pytest

import atra
from tests.closed_meshes import box, sphere


def test_rays_of_any_shape_and_one_origin_or_direction_for_all_are_taken():
    mesh = sphere(2)
    ways = np.random.default_rng(0).normal(size=(4, 5, 3)).astype(np.float32)
    origin = np.float32((0.1, 0.2, 0.0))
    with atra.RayScene(mesh, threads=1) as scene:
        expected = scene.intersect(np.tile(origin, (20, 1)), ways.reshape(-1, 3))
        for starts in (origin, origin[None], np.broadcast_to(origin, ways.shape)):
            found = scene.intersect(starts, ways, tfar=np.full((4, 5), np.inf))
            assert found.t.shape == (4, 5)
            np.testing.assert_array_equal(found.t.reshape(-1), expected.t)
            assert scene.count(starts, ways).shape == scene.occluded(starts, ways).shape == (4, 5)
        one = scene.intersect(origin, ways[0, 0])
        assert one.t.shape == ()
        assert one.t == expected.t[0]
        many = scene.intersect(ways / 10, origin)
        assert many.prim_id.shape == (4, 5)
        with pytest.raises(atra.InputError, match=r"origins have shape \(2, 3\) and directions \(4, 5, 3\)"):
            scene.count(np.zeros((2, 3)), ways)
        with pytest.raises(atra.InputError, match=r"directions have shape \(4, 5\)"):
            scene.count(origin, ways[..., 0])


def test_the_rays_of_a_camera_are_taken_as_they_are():
    camera = atra.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov_y_degrees=40, width=7, height=5)
    with atra.RayScene(sphere(2), threads=1) as scene:
        counts = scene.count(*camera.rays_world())
        assert counts.shape == (5, 7)
        assert counts[2, 3] == 2


def test_transforms_may_have_a_last_row_and_one_mesh_needs_no_list():
    mesh, move = box(), np.eye(4)
    move[0, 3] = 10.0
    rays = (10.0, 0.0, 5.0), (0.0, 0.0, -1.0)
    for transforms in (move, move[None], move[:3], move[None, :3]):
        with atra.RayScene(mesh, transforms=transforms, threads=1) as scene:
            assert scene.occluded(*rays)
    move[3] = (0, 0, 1, 1)
    with pytest.raises(atra.InputError, match=r"transform 0 has the last row \[0.0, 0.0, 1.0, 1.0\]"):
        atra.RayScene(mesh, transforms=move)


def test_a_transform_that_mirrors_turns_the_winding_and_keeps_ids_and_weights():
    ball = sphere(2)
    mirrors = np.diag([-2.0, 1.0, 1.0, 1.0]), np.eye(4)[[1, 0, 2, 3]], np.diag([-1.0, -1.0, -1.0, 1.0])
    rays = (0.1, 0.2, 5.0), (0.03, -0.02, -1.0)
    for mirror in mirrors:
        turned = np.linalg.inv(mirror)[:3, :3]
        with atra.RayScene(ball, threads=1) as plain, atra.RayScene(ball, transforms=mirror, threads=1) as scene:
            expected, found = plain.intersect(*(turned @ one for one in rays)), scene.intersect(*rays)
            assert found.prim_id == expected.prim_id
            np.testing.assert_allclose((found.u, found.v), (expected.u, expected.v), atol=1e-5)
            assert (found.normals * found.points).sum() > 0.5  # outwards
            np.testing.assert_allclose(found.points, mirror[:3, :3] @ expected.points, atol=1e-6)
            lists, own = scene.all_hits(*rays), plain.all_hits(*(turned @ one for one in rays))
            assert lists.prim_id.tolist() == own.prim_id.tolist()
            np.testing.assert_allclose((lists.u, lists.v), (own.u, own.v), atol=1e-5)
            assert lists.leaving.tolist() == [False, True]
            assert scene.gather(atra.Thickness(), *rays) == pytest.approx(lists.t[1] - lists.t[0], rel=1e-5)
            for method in ("parity", "winding"):
                assert scene.contains([(0.1, 0.2, 0.3), (0.1, 0.2, 3.0)], method=method).tolist() == [True, False]


def test_mirrored_copies_beside_others_are_as_solid_in_each_precision_and_after_an_update():
    cube = box((-1, -1, -1), (1, 1, 1))
    moved, mirrored = np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])
    moved[0, 3] = 5.0
    across = (-3.0, 0.1, 0.2), (1.0, 0.0, 0.0)
    for precision in ("exact", "watertight", "fast"):
        with atra.RayScene([cube, cube], transforms=[mirrored, moved], threads=1, precision=precision) as scene:
            for _ in range(2):
                assert scene.gather(atra.Thickness(), *across) == pytest.approx(4.0)
                assert scene.contains([(0, 0, 0), (5, 0, 0), (3, 0, 0)], method="winding").tolist() == [
                    True,
                    True,
                    False,
                ]
                hits = scene.intersect([(0.1, 0.2, 5.0), (5.1, 0.2, 5.0)], (0.0, 0.0, -1.0))
                assert hits.geometry_id.tolist() == [0, 1]
                assert hits.normals.tolist() == [[0, 0, 1], [0, 0, 1]]
                assert (hits.prim_id < cube.triangle_count).all()
                scene.update([cube, cube], [moved @ mirrored @ np.linalg.inv(moved), moved @ np.diag([-1, 1, 1, 1])])
                scene.update([cube, cube], [np.eye(4), moved @ mirrored])
            with pytest.raises(atra.InputError, match="expected other vertices of the same faces"):
                scene.update([cube, sphere(1)])


def test_an_update_keeps_the_transforms_unless_it_is_given_others():
    mesh, moves = box((-1, -1, -1), (1, 1, 1)), np.eye(3, 4)[None].copy()
    moves[0, 0, 3] = 10.0
    down = (0.1, 0.2, -1.0)
    with atra.RayScene(mesh, transforms=moves, threads=1) as scene:
        moves[:] = np.nan  # the scene has its own
        scene.update(atra.Mesh(2.0 * mesh.vertices, mesh.faces))
        assert scene.intersect((10.0, 0.0, 5.0), down).t == 3.0
        assert not scene.occluded((0.0, 0.0, 5.0), down)
        scene.update(mesh, np.eye(3, 4)[None])
        assert scene.intersect((0.0, 0.0, 5.0), down).t == 4.0


def test_hits_after_a_rebuild_that_failed_are_those_of_the_new_mesh(monkeypatch):
    mesh = box((-1, -1, -1), (1, 1, 1))
    turned = atra.Mesh(mesh.vertices @ np.float32([(0, -1, 0), (1, 0, 0), (0, 0, 1)]), mesh.faces)
    with atra.RayScene(mesh, threads=1) as scene:
        before = scene.all_hits((0.1, 0.2, 5.0), (0.0, 0.0, -1.0)).geometries
        with monkeypatch.context() as patch:
            patch.setattr(scene, "_build", lambda: 1 / 0)
            with pytest.raises(ZeroDivisionError):
                scene.update(turned)
        hits = scene.all_hits((0.1, 0.2, 5.0), (0.0, 0.0, -1.0))
        assert hits.geometries is not before
        assert hits.mesh is scene.mesh is scene.geometries.mesh


def test_an_update_that_is_refused_changes_nothing():
    mesh = box()
    with atra.RayScene(mesh, threads=1) as scene:
        for other in (sphere(1), atra.Mesh(mesh.vertices * np.float32(1e-12), mesh.faces)):
            with pytest.raises(atra.InputError):
                scene.update(other)
            assert scene.mesh is scene.geometries.mesh is mesh


def test_thickness_asks_whether_the_faces_that_rays_meet_are_closed():
    ball, one = sphere(2), box((2, -0.5, -0.5), (3, 0.5, 0.5))
    faces = np.concatenate([ball.faces, one.faces[1:] + len(ball.vertices)])
    both = atra.Mesh(np.concatenate([ball.vertices, one.vertices]), faces)
    is_ball = np.arange(len(faces)) < ball.triangle_count
    rays = (0.01, 0.02, 5.0), (0.0, 0.0, -1.0)
    with atra.RayScene(both, faces=is_ball, threads=1) as scene:
        assert scene.gather(atra.Thickness(), *rays) == pytest.approx(2.0, rel=0.05)
    with atra.RayScene(ball, faces=np.arange(ball.triangle_count) != 7, threads=1) as scene:
        with pytest.raises(atra.InputError, match="is not closed"):
            scene.gather(atra.Thickness(), *rays)
        assert scene.gather(atra.Transmittance(np.full(ball.triangle_count, 0.5)), *rays) == 0.25
    with atra.RayScene(ball, faces=np.zeros(ball.triangle_count, np.bool_), threads=1) as scene:
        assert scene.gather(atra.Thickness(), *rays) == 0.0


def test_gathering_reads_the_mesh_after_the_calls_before_it(monkeypatch):
    whole = box((-1, -1, -1), (1, 1, 1))
    open_one = atra.Mesh(np.where(whole.vertices > 0, whole.vertices, -whole.vertices), whole.faces)
    camera = atra.Camera(eye=(0, 0, 5), target=(0, 0, 0), fov_y_degrees=40, width=16, height=16)
    with atra.RasterTracer(whole, camera, threads=1) as tracer:
        seen = []

        def weights(self, mesh):
            seen.append(mesh)
            return np.full(mesh.triangle_count, 0.5, np.float32)

        monkeypatch.setattr(atra.Transmittance, "weights", weights)
        with tracer._lock:
            gathering = threading.Thread(target=lambda: tracer.gather(atra.Transmittance(0.5)))
            gathering.start()
            gathering.join(0.2)
            tracer.update(open_one)
        gathering.join(30)
        assert seen == [open_one]


@pytest.mark.parametrize("width", [0, -4, 2.5, "wide"])
def test_a_panorama_of_no_pixels_is_refused(width):
    with pytest.raises(atra.InputError, match="width is"):
        atra.LensCamera.panorama((0, 0, 0), (1, 0, 0), width=width)
