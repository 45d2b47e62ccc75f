"""The rasteriser's promise: the image of the rays, whatever the mesh, the view, the size and the machine."""

import numpy as np
import pytest

import atra
from tests.images import assert_equal_images, assert_same_bits, draw, trace_pixels
from tests.judge.reference import brute_force
from tests.machine import FEW_LANES, LANES, NATIVE_LANES
from tests.meshes import (
    EYE_AT_ORIGIN,
    cornell_box,
    cornell_camera,
    quads,
    random_triangles,
)

OFFSETS = [(0.5, 0.5), (0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)]
QUICK_LANES = tuple(lanes for lanes in LANES if lanes in (FEW_LANES, NATIVE_LANES))
"""The narrowest and the native width; each one takes five seconds to compile."""


def lanes_and_slow(quick):
    """All widths as cases of a test; those that are not quick are slow."""
    return pytest.mark.parametrize(
        "lanes", [lanes if lanes in quick else pytest.param(lanes, marks=pytest.mark.slow) for lanes in LANES]
    )


every_width = lanes_and_slow(QUICK_LANES)
every_width_the_native_quick = lanes_and_slow((NATIVE_LANES,))
PARALLEL = atra.OrthographicCamera((0, 0, 0), (0, 0, 1), view_height=4.0, width=48, height=30)


@pytest.mark.core
@every_width
@pytest.mark.parametrize("seed", range(6))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(seed, lanes):
    mesh = random_triangles(60, seed)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=[20, 90, 150, 170, 178, 0.01][seed])
    for offset in OFFSETS:
        assert_equal_images(mesh, camera, draw(mesh, camera, offset, lanes=lanes), brute_force(mesh, camera, offset))


@pytest.mark.core
@every_width_the_native_quick
@pytest.mark.parametrize("seed", range(4))
def test_parallel_rays_give_the_float64_image_of_triangles_all_around(seed, lanes):
    mesh = random_triangles(60, seed)
    pose = [{"eye": (0, 0, 0), "target": (0, 0, 1)}, {"eye": (0.3, 0.2, -0.4), "target": (1, 2, 3)}][seed % 2]
    camera = atra.OrthographicCamera(**pose, view_height=[1.0, 5.0, 12.0, 0.1][seed], width=40, height=24)
    for offset in OFFSETS:
        assert_equal_images(mesh, camera, draw(mesh, camera, offset, lanes=lanes), brute_force(mesh, camera, offset))


@pytest.mark.parametrize("seed", range(4))
def test_small_triangles_give_the_float64_image(seed):
    mesh = random_triangles(1500, seed, size=[0.3, 0.1, 0.03, 0.01][seed])
    for camera in (
        atra.Camera(**EYE_AT_ORIGIN, width=96, height=54, fov_y_degrees=100),
        atra.OrthographicCamera((0, 0, -3), (0, 0, 1), view_height=6.0, width=96, height=54),
    ):
        assert_equal_images(mesh, camera, draw(mesh, camera), brute_force(mesh, camera))


def test_the_eye_on_a_surface_sees_the_float64_image():
    mesh = cornell_box()
    random = np.random.default_rng(0)
    for _ in range(12):
        corners = mesh.triangles(np.array([random.integers(mesh.triangle_count)]))[0]
        eye = random.dirichlet(np.ones(3)) @ corners
        target = eye + random.normal(size=3)
        camera = atra.Camera(tuple(eye), tuple(target), (0.1, 1, 0.2), random.uniform(20, 150), 32, 24)
        # Whether the triangle under the eye is before or behind it, float64 cannot say.
        agreement = atra.compare(draw(mesh, camera), brute_force(mesh, camera))
        assert agreement.pixels_wrong == 0, str(agreement)


def test_a_triangle_whose_plane_holds_the_eye_is_not_seen_and_hides_nothing():
    wall = quads([[(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]])
    edge_on = [(0, -1, 1), (0, 1, 1), (0, 0, 3), (-1, 0, 2), (1, 0, 2), (0, 0, 4)]
    mesh = atra.Mesh(np.concatenate([wall.vertices, edge_on]), np.concatenate([wall.faces, [[4, 5, 6], [7, 8, 9]]]))
    for size in (16, 17):  # rays beside the planes, and in them
        camera = atra.Camera(**EYE_AT_ORIGIN, width=size, height=size, fov_y_degrees=60)
        hits = draw(mesh, camera)
        assert (hits.prim_id < 2).all()
        np.testing.assert_array_equal(hits.depth, 5.0)


@pytest.mark.core
@pytest.mark.parametrize(
    "size",
    [(1, 1), (1, 37), (37, 1), (15, 9), (16, 16), (17, 33), (33, 7), (130, 140), (4100, 3), (3, 4100), (16384, 8)],
)
def test_every_size_gives_the_image_of_single_rays_with_any_lanes_and_threads(size):
    mesh = atra.Mesh(
        np.concatenate([cornell_box().vertices, random_triangles(300, 5, 0.05, 1.0).vertices]),
        np.concatenate([cornell_box().faces, random_triangles(300, 5).faces + len(cornell_box().vertices)]),
    )
    camera = cornell_camera(*size)
    hits = draw(mesh, camera)
    agreement = atra.compare(hits, trace_pixels(mesh, camera))
    assert agreement.pixels_wrong == 0, str(agreement)
    for lanes in QUICK_LANES:
        for threads in (1, 2):
            assert_same_bits(draw(mesh, camera, lanes=lanes, threads=threads), hits)


def test_a_depth_is_off_by_two_units_of_float32_where_a_triangle_is_not_steep():
    mesh, camera = cornell_box(), cornell_camera(256, 256)
    hits = draw(mesh, camera)
    own = atra.compare(hits, hits).depth_errors
    rays = trace_pixels(mesh, camera)
    of_rays = atra.compare(rays, rays).depth_errors
    assert own.largest <= 2.0**-22
    assert own.largest <= of_rays.largest
    assert own.p999 <= of_rays.p999


def test_of_triangles_in_one_plane_the_lowest_is_stored():
    corners = [(-2, -2, 4), (2, -2, 4), (2, 2, 4), (-2, 2, 4)]
    twice = quads([corners, corners, [(x / 2, y / 2, z) for x, y, z in corners]])
    for order in ([0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0], [2, 3, 0, 1, 4, 5]):
        mesh = atra.Mesh(twice.vertices, twice.faces[order])
        for camera in (atra.Camera(**EYE_AT_ORIGIN, width=48, height=48), PARALLEL):
            offset = (0.3, 0.6)  # no ray through the diagonal
            reference = brute_force(mesh, camera, offset)
            np.testing.assert_array_equal(draw(mesh, camera, offset).prim_id, reference.prim_id)
