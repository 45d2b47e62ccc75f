"""Float32 tells the pixels of a narrow view apart, whatever way the camera looks."""

import numpy as np
import pytest

import atra
from atra.ray_space import NARROWEST_WORLD_PITCH, from_eye_space, ray_axes, to_ray_space
from atra.reference import brute_force

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


def camera_of(fov_y_degrees):
    return atra.Camera(**SLANTED, fov_y_degrees=fov_y_degrees, width=96, height=64)


@pytest.mark.parametrize("fov", [0.5, 0.1, 1e-2, 1e-3])
def test_a_narrow_slanted_view_is_the_float64_image_by_every_method(fov):
    camera = camera_of(fov)
    assert camera.pixel_pitch < NARROWEST_WORLD_PITCH
    mesh = confetti(camera)
    reference = brute_force(mesh, camera)
    assert len(np.unique(reference.prim_id)) > 50
    for tracer in (
        atra.PixelTracer(mesh, camera, packet_width=1),
        atra.AlignedTracer(mesh, camera, (12, 2)),
        atra.AlignedTracer(mesh, camera, (12, 2), culling=False),
        atra.AlignedTracer(mesh, camera, (12, 2), culling=False, geometry="instanced"),
        atra.VisibleFirstTracer(mesh, camera, (12, 2)),
        atra.TiledTracer(mesh, camera, (12, 2)),
    ):
        with tracer:
            agreement = atra.compare(mesh, camera, tracer.trace(), reference)
        assert agreement.pixels_wrong == 0, str(agreement)
        assert agreement.pixels_equal >= 0.98 * agreement.pixels, str(agreement)


def test_wide_views_keep_the_axes_of_the_world_and_narrow_ones_take_the_cameras():
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 5.0, 6.0]])
    wide, narrow = camera_of(60.0), camera_of(0.1)
    np.testing.assert_array_equal(to_ray_space(wide, points), wide.to_eye_space(points))
    np.testing.assert_array_equal(ray_axes(wide), wide.axes)
    np.testing.assert_allclose(to_ray_space(narrow, points), narrow.to_camera_space(points), rtol=1e-14)
    np.testing.assert_array_equal(ray_axes(narrow), np.eye(3))
    for camera in (wide, narrow):
        np.testing.assert_allclose(camera.axes @ from_eye_space(camera).T, ray_axes(camera), atol=1e-15)
