"""Float32 tells the pixels of a narrow view apart, and what it cannot trace is refused."""

import numpy as np
import pytest

import atra
from atra.geometry import ray_space
from atra.geometry.ray_space import NARROWEST_WORLD_PITCH, from_eye_space, ray_axes, to_ray_space
from tests.images import METHODS, PARALLEL, assert_equal_images, assert_no_pixel_wrong, make_tracer, trace
from tests.judge.reference import brute_force

SLANTED = {"eye": (0.1, 0.2, 0.3), "target": (3.1, 2.2, 9.3)}
"""A camera with no axis along one of the world's."""


def confetti(camera, count=100):
    """Triangles of some ten pixels, all over the view, 5 to 10 scene units away."""
    random = np.random.default_rng(0)
    half = camera.height / 2 * camera.pixel_pitch
    place = random.uniform(-1, 1, (count, 1, 2)) + random.uniform(-0.15, 0.15, (count, 3, 2))
    points = np.concatenate([place * half, np.ones((count, 3, 1))], axis=2) * random.uniform(5, 10, (count, 3, 1))
    vertices = points.reshape(-1, 3) @ camera.axes + camera.eye
    return atra.Mesh(vertices, np.arange(3 * count).reshape(-1, 3), "confetti")


def pinhole(scale, distance=2.0):
    """A view that has the bumpy square of the same scale in it, at so many times half its size."""
    fov = float(np.degrees(2.0 * np.arctan(1.0 / distance)))
    return atra.Camera((0, 0, distance * scale), (0, 0, 0), fov_y_degrees=fov, width=32, height=32)


def parallel(scale, distance=2.0):
    return atra.OrthographicCamera((0, 0, distance * scale), (0, 0, 0), view_height=2 * scale, width=32, height=32)


def bumpy_square(scale, count=20):
    """count x count bumpy quadrilaterals, 2 * scale wide."""
    y, x = np.mgrid[: count + 1, : count + 1] / count * 2 - 1
    points = np.stack([x, y, 0.05 * np.sin(9 * x) * np.cos(7 * y)], axis=2).reshape(-1, 3)
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1, 1)
    faces = np.concatenate([first + [0, 1, count + 1], first + [1, count + 2, count + 1]])
    return atra.Mesh((points * scale).astype(np.float32), faces, "bumpy")


def assert_float64_image(mesh, camera, methods):
    reference = brute_force(mesh, camera)
    assert reference.hit.sum() > 500
    for method in methods:
        assert_no_pixel_wrong(mesh, camera, trace(method, mesh, camera, (4, 1)), reference)


@pytest.mark.parametrize("scale", [ray_space.SMALLEST_SIZE * 0.51, ray_space.FARTHEST_FROM_EYE * 0.48])
def test_the_smallest_and_largest_mesh_that_are_not_refused_give_the_float64_image(scale):
    assert_float64_image(bumpy_square(scale), pinhole(scale), METHODS)
    assert_float64_image(bumpy_square(scale), parallel(scale), PARALLEL)


def test_the_farthest_eye_that_is_not_refused_gives_the_float64_image():
    size = 1e6
    assert_float64_image(bumpy_square(size), pinhole(size, 0.99 * ray_space.FARTHEST_FROM_EYE / size), METHODS)


@pytest.mark.parametrize("method", METHODS)
def test_a_mesh_too_small_or_too_far_for_float32_is_refused_with_the_reason(method):
    for view in (pinhole, parallel) if method in PARALLEL else (pinhole,):
        for size, distance, message in (
            (4.9e-10, 2, r"'bumpy' is 9\.8e-10 in size, expected at least 1e-09.*scale .* up"),
            (5.1e10, 2, r"'bumpy' reaches 1\.\d+e\+11 from the eye .* at most 1e\+11.*scale .* down"),
            (1.0, 1e18, r"reaches 1e\+18 from the eye"),
        ):
            with pytest.raises(atra.InputError, match=message):
                make_tracer(method, bumpy_square(size), view(size, distance), (4, 1))


def test_every_frame_is_checked():
    near, far = pinhole(1.0), pinhole(1.0, 1e18)
    alignment = atra.Alignment.of_frames([near, near], atra.Split(4, 1, 32, 32))
    with pytest.raises(atra.InputError, match="'bumpy' is 2e-15 in size"):
        atra.FramesTracer([bumpy_square(1.0), bumpy_square(1e-15)], alignment, threads=1)
    alignment = atra.Alignment.of_frames([far, far], atra.Split(4, 1, 32, 32))
    with pytest.raises(atra.InputError, match="'bumpy' reaches"):
        atra.FramesTracer(bumpy_square(1.0), alignment, threads=1)


def test_a_mesh_without_area_has_no_size_to_be_too_small_and_a_vertex_in_no_face_is_not_too_far():
    mesh = atra.Mesh([[0, 0, 0], [1e-20, 0, 0], [-9e11, 0, 0]], [[0, 1, 1], [0, 0, 0]])  # the last is in no face
    with atra.PixelTracer(mesh, pinhole(1.0), threads=1) as tracer:
        assert not tracer.trace().hit.any()


def camera_of(fov_y_degrees):
    return atra.Camera(**SLANTED, fov_y_degrees=fov_y_degrees, width=96, height=64)


@pytest.mark.parametrize("fov", [0.5, 1e-3])
def test_a_narrow_slanted_view_is_the_float64_image_by_every_method(fov):
    camera = camera_of(fov)
    assert camera.pixel_pitch < NARROWEST_WORLD_PITCH
    mesh = confetti(camera)
    reference = brute_force(mesh, camera)
    assert len(np.unique(reference.prim_id)) > 50
    for method in METHODS:
        assert_equal_images(mesh, camera, trace(method, mesh, camera, (12, 2)), reference)


def test_wide_views_keep_the_axes_of_the_world_and_narrow_ones_take_the_cameras():
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, 6.0]])
    wide, narrow = camera_of(60.0), camera_of(0.1)
    np.testing.assert_array_equal(to_ray_space(wide, points), wide.to_eye_space(points))
    np.testing.assert_array_equal(ray_axes(wide), wide.axes)
    np.testing.assert_allclose(to_ray_space(narrow, points), narrow.to_camera_space(points), rtol=1e-14)
    np.testing.assert_array_equal(ray_axes(narrow), np.eye(3))
    for camera in (wide, narrow):
        np.testing.assert_allclose(camera.axes @ from_eye_space(camera).T, ray_axes(camera), atol=1e-15)
