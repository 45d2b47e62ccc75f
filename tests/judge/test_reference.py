"""The float64 judge against closed forms: it must be right on its own, since everything else is held against it."""

import numpy as np
import pytest

from atra.errors import InputError
from atra.exact.intersection import intersect_pixels
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.prim_ids import MISS
from tests.judge.reference import brute_force

# Looks along -z from the origin: camera (X, Y, Z) = world (x, -y, -z).
FORWARD = {"eye": (0.0, 0.0, 0.0), "target": (0.0, 0.0, -1.0), "fov_y_degrees": 90.0}


def forward_camera(width=16, height=16):
    return Camera(**FORWARD, width=width, height=height)


def forward_parallel(width=16, height=16):
    return OrthographicCamera(FORWARD["eye"], FORWARD["target"], view_height=2.0, width=width, height=height)


def quad(depths, half=100.0):
    """A square seen face-on whose left and right edges lie at the two given depths."""
    left, right = depths
    corners = [(-half, -half, -left), (half, -half, -right), (half, half, -right), (-half, half, -left)]
    return np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])


def test_depth_of_a_tilted_plane_is_its_closed_form():
    camera = forward_camera(24, 16)
    hits = brute_force(Mesh(*quad((2.0, 6.0), half=4.0)), camera)
    # The plane is Z = 4 + X / 2, and X = Z dx.
    y, x = np.mgrid[0:16, 0:24]
    direction = camera.rays(x, y)[1]
    expected = 4.0 / (1.0 - direction[..., 0] / 2.0)
    inside = (np.abs(expected * direction[..., 0]) < 4.0) & (np.abs(expected * direction[..., 1]) < 4.0)
    assert inside.any()
    assert not inside.all()
    assert np.array_equal(hits.hit, inside)
    assert np.allclose(hits.depth[inside], expected[inside], rtol=1e-6)
    assert (hits.depth[~inside] == np.inf).all()
    assert (hits.prim_id[~inside] == MISS).all()


def test_depth_of_a_tilted_plane_under_parallel_rays_is_linear_and_its_sides_stay_parallel():
    camera = forward_parallel(24, 16)
    hits = brute_force(Mesh(*quad((2.0, 6.0), half=0.9)), camera, (0.25, 0.5))
    origins, _ = camera.rays(*np.meshgrid(np.arange(24), np.arange(16)), (0.25, 0.5))
    inside = (np.abs(origins[..., :2]) < 0.9).all(axis=-1)
    assert np.array_equal(hits.hit, inside)
    assert np.allclose(hits.depth[inside], (4.0 + origins[..., 0] * 2.0 / 0.9)[inside], rtol=1e-6)
    assert (hits.depth[~inside] == np.inf).all()


def test_a_staircase_shows_the_nearest_step_of_each_column():
    steps = 8
    vertices, faces = [], []
    for i in range(steps):  # step i covers the columns from i on, each nearer than the last; listed far to near
        depth = 10.0 - i
        x0 = (-1.0 + 2.0 * i / steps) * depth
        vertices += [(x0, -20, -depth), (20, -20, -depth), (20, 20, -depth), (x0, 20, -depth)]
        faces += [(4 * i, 4 * i + 1, 4 * i + 2), (4 * i, 4 * i + 2, 4 * i + 3)]
    for order in (slice(None), slice(None, None, -1)):
        hits = brute_force(Mesh(vertices, np.array(faces)[order]), forward_camera(2 * steps, 2 * steps))
        assert np.array_equal(hits.depth, np.tile(10.0 - np.arange(2 * steps) // 2, (2 * steps, 1)))


def test_rays_through_shared_edges_and_vertices_are_not_lost():
    # Odd image: the centre ray meets the vertex of the fan, its row, column and diagonals meet the edges.
    rim = [(np.cos(t), np.sin(t), -1.0) for t in np.arange(8) * np.pi / 4]
    fan = Mesh([(0, 0, -1.0), *[tuple(40 * c if i < 2 else c for i, c in enumerate(p)) for p in rim]],
               [(0, 1 + i, 1 + (i + 1) % 8) for i in range(8)])  # fmt: skip
    assert brute_force(fan, forward_camera(33, 33)).hit.all()


def test_of_equally_deep_triangles_the_lowest_prim_id_wins():
    vertices, faces = quad((3.0, 3.0))
    twice = Mesh(np.concatenate([vertices, vertices]), np.concatenate([faces + 4, faces]))
    hits = brute_force(twice, forward_camera())
    assert set(hits.prim_id.flat) == {0, 1}


def test_triangles_behind_the_eye_are_not_hit():
    mesh, one = Mesh(*quad((-2.0, -2.0))), np.array([7])
    for camera in (forward_camera(), forward_parallel()):
        assert not brute_force(mesh, camera).hit.any()
        found = intersect_pixels(mesh, camera, one, one, np.array([0]))
        assert (found.depth[0], found.edge_distance[0]) == (np.inf, -np.inf)
        assert np.isnan(found.u[0])


def test_degenerate_and_edge_on_triangles_are_never_hit_and_leave_no_nan_depth():
    vertices = [(-9, 0, -3), (9, 0, -3), (0, 0, -3), (0, 0, -1), (5, 0, -9)]
    mesh = Mesh(vertices, [(0, 1, 2), (0, 0, 1), (0, 3, 4)])  # collinear, collapsed, and in the plane y = 0
    camera = forward_camera(5, 5)
    x = np.array([2, 2, 2])
    found = intersect_pixels(mesh, camera, x, x, np.arange(3), (0.5, 0.5))
    assert (found.depth == np.inf).all()
    assert (found.edge_distance == -np.inf).all()
    assert not brute_force(mesh, camera).hit.any()
    mesh = Mesh([(0.1, 0.1, 0.1), (0.2, 0.2, 0.2), (0.4, 0.4, 0.4)], [(0, 1, 2)])  # flattened by rounding only
    camera = Camera(eye=(1.3, 0.7, 2.9), target=(0.2, 0.2, 0.2), width=9, height=9)
    y, x = np.divmod(np.arange(81), 9)
    assert (intersect_pixels(mesh, camera, x, y, np.zeros(81, int)).depth == np.inf).all()


def test_a_prim_id_or_offset_that_does_not_exist_is_refused():
    mesh, zero = Mesh(*quad((2.0, 2.0))), np.array([0])
    with pytest.raises(InputError, match="prim_id 4294967295"):
        intersect_pixels(mesh, forward_camera(), zero, zero, np.array([MISS]))
    with pytest.raises(InputError, match="offset is"):
        brute_force(mesh, forward_camera(), (1.5, 0.5))
