"""What is inside: parity decided exactly, winding numbers of open meshes, and reductions over all hits."""

import numpy as np
import pytest
import trimesh

import atra
from atra.rays.all_hits.cells import FEWEST_POINTS
from tests.closed_meshes import box, cornell_boxes, sphere
from tests.meshes import random_triangles
from tests.rays.whole_numbers import SIZE, whole_crossings, whole_meshes


def is_on_surface(mesh, points):
    """(P,) bool: in the plane of a triangle, and in its box."""
    corners = mesh.vertices.astype(np.int64)[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    heights = ((points[:, None] - corners[None, :, 0]) * normals).sum(axis=2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    in_box = ((points[:, None] >= low) & (points[:, None] <= high)).all(axis=2)
    return ((heights == 0) & in_box).any(axis=1)


def test_points_lie_inside_as_whole_numbers_say_also_above_corners_and_edges():
    for mesh, is_closed in whole_meshes().values():
        if not is_closed:
            continue
        random = np.random.default_rng(0)
        points = random.integers(-SIZE, SIZE, (1500, 3))
        points[:1000, :2] = mesh.vertices[random.integers(0, len(mesh.vertices), 1000), :2]
        points = points[~is_on_surface(mesh, points)]
        counts = [
            (whole_crossings(mesh, points, np.tile(way, (len(points), 1)))[0] != 0).sum(axis=1)
            for way in ([0, 0, 1], [3, -7, 5])
        ]
        assert (counts[0] % 2 == counts[1] % 2).all()
        with atra.RayScene(mesh, threads=1) as scene:
            found = scene.contains(points)
        assert (found == counts[0] % 2).all()
        assert len(points) > 1200
        assert 0.1 < found.mean() < 0.9


def test_points_are_taken_as_float64_without_rounding():
    with atra.RayScene(box(), threads=1) as scene:
        points = np.full((4, 3), 0.25)
        points[:, 0] = 1.0 - 1e-15, 1.0 + 1e-15, -1.0 - 1e-15, -1.0 + 1e-15
        for axis in range(3):
            assert scene.contains(np.roll(points, axis, axis=1)).tolist() == [True, False, False, True]
        assert scene.contains(np.zeros((0, 3))).shape == (0,)
        for wrong, message in (
            (np.zeros((2, 2)), "points have shape"), ([[0, np.nan, 0]], "point 0 is"), (["a"], "dtype"),
        ):  # fmt: skip
            with pytest.raises(atra.InputError, match=message):
                scene.contains(wrong)
        with pytest.raises(atra.InputError, match="method is 'sign'"):
            scene.contains(points, method="sign")


def test_many_points_are_decided_as_few_are():
    for mesh, is_closed in whole_meshes().values():
        points = np.random.default_rng(0).uniform(-1.1 * SIZE, 1.1 * SIZE, (FEWEST_POINTS, 3))
        points[:3000] = np.rint(points[:3000])
        with atra.RayScene(mesh, threads=1) as scene:
            interior = scene._current_interior()
            many = interior.parity(points)
            assert (interior.cells is not None) == is_closed
            assert (interior.parity(points[:5000]) == many[:5000]).all()
            few = (interior.finder.columns(points).counts & 1).astype(bool)
        on_surface = is_on_surface(mesh, points[:3000].astype(np.int64))
        assert (many == few)[3000:].all()
        assert (many == few)[:3000][~on_surface].all()


def solid_angles(mesh, points):
    """Winding numbers by the solid angle of every triangle."""
    corners = mesh.triangles(np.arange(mesh.triangle_count))[None] - points[:, None, None]
    a, b, c = np.moveaxis(corners, 2, 0)
    x, y, z = (np.linalg.norm(one, axis=-1) for one in (a, b, c))
    rest = x * y * z + (a * b).sum(-1) * z + (b * c).sum(-1) * x + (c * a).sum(-1) * y
    return (2 * np.arctan2((a * np.cross(b, c)).sum(-1), rest)).sum(axis=1) / (4 * np.pi)


def test_winding_numbers_of_open_meshes_are_sums_of_solid_angles():
    ball = trimesh.creation.icosphere(subdivisions=2)
    cup = atra.Mesh(ball.vertices, ball.faces[ball.triangles_center[:, 2] < 0.4])
    random = np.random.default_rng(0)
    for mesh in (cup, random_triangles(30, 1), atra.Mesh(np.eye(3), [[0, 1, 2]] * 3), sphere()):
        points = random.uniform(-1.5, 1.5, (400, 3))
        with atra.RayScene(mesh, threads=1) as scene:
            found = scene._current_interior().winding_numbers(points)
            expected = solid_angles(mesh, points)
            assert found == pytest.approx(expected, abs=1e-9)
            assert (scene.contains(points, method="winding") == (expected > 0.5)).all()
    with atra.RayScene(cup) as scene, pytest.raises(atra.InputError, match="not closed: it has 24 open edges"):
        scene.contains(points)


def test_a_closed_mesh_of_any_orientation_has_an_inside():
    one = box()
    faces = one.faces.copy()
    faces[::2] = faces[::2, ::-1]
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (500, 3))
    with atra.RayScene(atra.Mesh(one.vertices, faces), threads=1) as scene:
        assert (scene.contains(points) == (np.abs(points) < 1).all(axis=1)).all()


def test_reductions_of_rays_are_those_of_their_lists():
    mesh = cornell_boxes()
    random = np.random.default_rng(0)
    origins, directions = random.uniform(-1, 1.5, (3000, 3)), random.normal(size=(3000, 3))
    rays = atra.Rays(origins, directions, 0.1, random.uniform(0.3, 3, 3000))
    factors = random.uniform(0.2, 1, mesh.triangle_count).astype(np.float32)
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(rays)
        assert (scene.gather(atra.Count(), rays) == hits.counts).all()
        product = np.ones(3000)
        np.multiply.at(product, hits.ray_ids, factors[hits.prim_id].astype(float))
        assert scene.gather(atra.Transmittance(factors), rays) == pytest.approx(product, rel=1e-6)
        layers = scene.gather(atra.Layers(2), rays)
        assert (layers.count == hits.counts).all()
        first = hits.ray_splits[:-1][hits.counts > 0]
        assert (layers.t[0][hits.counts > 0] == hits.t[first].astype(np.float32)).all()
        assert (layers.prim_id[0][hits.counts > 0] == hits.prim_id[first]).all()
        assert (layers.prim_id[:, hits.counts == 0] == atra.MISS).all()
        steps = (np.arange(2000) + 0.5) / 2000
        some = slice(0, 100)
        length = np.maximum(rays.tfar - rays.tnear, 0)[some]
        t = rays.tnear[some, None] + length[:, None] * steps
        inside = scene.contains((rays.origins[some, None] + t[..., None] * rays.directions[some, None]).reshape(-1, 3))
        expected = inside.reshape(100, -1).mean(axis=1) * length
        assert scene.gather(atra.Thickness(), rays)[some] == pytest.approx(expected, abs=5e-3)
        assert expected.max() > 0.3
        with pytest.raises(atra.InputError, match="cannot gather"):
            scene.gather("count", rays)
    with atra.RayScene(random_triangles(3, 0)) as scene, pytest.raises(atra.InputError, match="not closed"):
        scene.gather(atra.Thickness(), rays)
