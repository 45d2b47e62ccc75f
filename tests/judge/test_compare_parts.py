"""What `compare` is made of, each part against a slower reckoning of its own."""

from importlib import import_module
from itertools import product

import numpy as np
import pytest

from atra.exact import outline as outline_module
from atra.exact import rounding as rounding_module
from atra.exact.intersection import Pairs
from atra.exact.rounding import Rounding
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.hits import Hits
from atra.judge.depths import has_wrong_depth, relative_depth_error
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, random_triangles

judge = import_module("atra.judge.compare")  # the module; `atra.judge.compare` by name is its function
OFFSET = (0.2, 0.7)
ASLANT = {"eye": (0.3, -0.2, 0.1), "target": (1, 2, 3), "width": 12, "height": 9}
CAMERAS = {"pinhole": Camera(**ASLANT, fov_y_degrees=80.0), "parallel": OrthographicCamera(**ASLANT, view_height=4.0)}
each_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)

DEGENERATE = [
    [(1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (1.5, 1.0, 3.0)],  # two corners in one place
    [(0.9, 2.0, 3.0), (0.9, 2.0, 3.0), (0.9, 2.0, 3.0)],  # a point
    [(0.0, 1.0, 2.0), (1.0, 2.0, 3.0), (2.0, 3.0, 4.0)],  # a line
]


def every_pair(mesh, camera):
    """Each triangle with the ray of each pixel."""
    prim_id, y, x = np.indices((mesh.triangle_count, camera.height, camera.width)).reshape(3, -1)
    return Pairs(mesh, camera, x, y, prim_id, OFFSET)


def points_on_image(camera, a, b):
    """800 points along the edge from `a` to `b` on the image plane, as far as it is in front of the eye."""
    if max(a[2], b[2]) <= 0.0:
        return np.full((1, 2), np.inf)
    near, far = sorted((a, b), key=lambda corner: corner[2])
    start = far[:2] if camera.is_parallel else far[:2] / far[2]
    if near[2] > 0.0:
        end = near[:2] if camera.is_parallel else near[:2] / near[2]
    else:
        crossing = (far + (near - far) * far[2] / (far[2] - near[2]))[:2]
        # An edge through the eye's plane is a half-line on the image, in the direction of where it passes.
        end = crossing if camera.is_parallel else start + 8.0 * crossing / np.linalg.norm(crossing)
    return start + np.linspace(0.0, 1.0, 800)[:, None] * (end - start)


@each_camera
def test_distance_to_the_outline_is_that_to_the_nearest_of_many_points_on_it(camera, monkeypatch):
    tolerance = 0.4
    monkeypatch.setattr(outline_module, "OUTLINE_TOLERANCE_PIXELS", tolerance)
    vertices = np.concatenate([random_triangles(30, seed=8, spread=2.0).vertices, np.reshape(DEGENERATE, (-1, 3))])
    mesh = Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    pairs = every_pair(mesh, camera)
    found = outline_module.is_on_outline(pairs).reshape(mesh.triangle_count, -1)
    corners = camera.to_camera_space(mesh.vertices)[mesh.faces]
    rays = np.add(*pairs.rays).reshape(mesh.triangle_count, -1, 3)[0]
    rays_on_image = rays[:, :2]  # at depth 1, for both cameras
    for triangle, is_on_outline in zip(corners, found, strict=True):
        outline = np.concatenate([points_on_image(camera, triangle[i], triangle[i - 1]) for i in range(3)])
        apart = np.linalg.norm(rays_on_image[:, None] - outline, axis=2).min(axis=1) / camera.pixel_pitch
        clear = np.abs(apart - tolerance) > 0.01
        assert np.array_equal(is_on_outline[clear], apart[clear] < tolerance)
    assert 0.02 < found.mean() < 0.5
    assert found[-3:].any(axis=1).all()


def test_errors_of_float32_are_those_derived_for_a_3_4_5_triangle_13_away():
    corners = [(0.0, 0.0, 12.0), (3.0, 0.0, 12.0), (3.0, 4.0, 12.0)]
    camera = Camera(**EYE_AT_ORIGIN, fov_y_degrees=90.0, width=8, height=8)
    # The ray (1, 1, 8) / 8 meets it at (1.5, 1.5, 12), and its normal is (0, 0, 12).
    at_3_3 = np.array([3])
    pairs = Pairs(one_triangle(*corners), camera, at_3_3, at_3_3, np.array([0]), (0.5, 0.5))
    rounding = Rounding.of(pairs)
    far, longest, twice_the_area = 13, 5, 12
    assert np.allclose(rounding.corners * 2**24, 4 * far)
    assert np.allclose(rounding.edges * 2**24, 4 * far * longest)
    assert np.allclose(rounding.ahead * 2**24, 4 * twice_the_area * 12)
    # Corners once, the direction as a sum of two and as a sum, and three for products and quotient.
    assert np.allclose(rounding.facing * 2**24, 4 * twice_the_area * (2 + 3))
    assert np.allclose(rounding.depth * 2**24, 4 * (1 + 2 + 3))


@each_camera
def test_undecided_is_where_errors_turn_a_hit_into_a_miss_or_back(camera, monkeypatch):
    monkeypatch.setattr(rounding_module, "FLOAT32_UNIT", 2.0**-7)  # so coarse that many pairs are concerned
    pairs = every_pair(random_triangles(40, seed=9, spread=2.0), camera)
    rounding, volumes = Rounding.of(pairs), pairs.volumes
    error = rounding.edges * np.linalg.norm(pairs.rays[1], axis=1)
    sides = volumes.u, volumes.v, volumes.facing - volumes.u - volumes.v
    outcomes = []
    for *turns, turn in product((-1, 1), repeat=4):
        signs = [np.sign(side + way * error) for side, way in zip(sides, turns, strict=True)]
        signs.append(np.sign(volumes.ahead + turn * rounding.ahead))
        outcomes.append(np.abs(np.sum(signs, axis=0)) == 4)
    some, every = np.any(outcomes, axis=0), np.all(outcomes, axis=0)
    before_eye = (pairs.corners[..., 2] > -rounding.corners[:, None]).any(axis=1)
    expected = some & ~every & before_eye
    assert np.array_equal(judge._is_undecided(pairs, rounding), expected)
    assert 0.02 < expected.mean() < 0.5
    assert (some & ~every & ~before_eye).any()


def one_triangle(*corners):
    return Mesh(np.array(corners), np.array([[0, 1, 2]]))


@each_camera
def test_a_depth_is_right_as_far_as_float32_may_be_off_and_no_farther(camera):
    mesh = random_triangles(60, seed=4, spread=2.0)
    seen = brute_force(mesh, camera, OFFSET)
    y, x = np.nonzero(seen.hit)
    pairs = Pairs(mesh, camera, x, y, seen.prim_id[y, x], OFFSET)
    depth, allowed = pairs.intersections.depth, Rounding.of(pairs).depth
    assert (allowed < 1e-4).mean() > 0.9
    for share, expected in ((0.0, False), (0.9, False), (-0.9, False), (1.1, True), (-1.1, True)):
        stored = seen.depth.copy()
        stored[y, x] = depth * (1.0 + share * allowed)
        image = Hits(stored, seen.prim_id, OFFSET, mesh, camera)
        wrong = has_wrong_depth(mesh, camera, image, relative_depth_error(mesh, camera, image))
        assert (wrong[y, x] == expected).all()
        assert not wrong[~seen.hit].any()
