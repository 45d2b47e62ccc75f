"""Pictures through a lens: as without one that bends nothing, black where there is no ray, alike from any tracer; and
through an aperture, by the circle of confusion."""

from functools import partial

import numpy as np
import pytest

import atra
from atra import light
from tests.lenses import lens_camera
from tests.meshes import cornell_box, cornell_camera, quads
from tests.shown import BLACK, floor, picture

PLACED, BOX = cornell_camera(96, 72), light.Scene(cornell_box())
RENDERERS = (light.HybridRenderer, light.PathRenderer)


@pytest.mark.parametrize("kind", RENDERERS)
def test_a_lens_that_bends_nothing_changes_no_picture(kind):
    camera = lens_camera(atra.OpenCVLens(k1=1e-13), PLACED)
    with_lens, without = (picture(kind, BOX, one, 2) for one in (camera, camera.undistorted()))
    assert without.max() > 0.0
    np.testing.assert_allclose(with_lens, without, atol=1e-5)


@pytest.mark.parametrize("kind", RENDERERS)
def test_what_a_lens_bends_is_seen_where_it_bends_it(kind):
    camera = lens_camera(atra.OpenCVLens(k1=-0.3, k2=0.08), PLACED)
    drawn, bent = (picture(kind, BOX, one, 2, jitter="off") for one in (camera, camera.undistorted()))
    traced = picture(kind, BOX, camera, 2, partial(atra.PixelTracer, threads=1), jitter="off")
    assert (np.abs(drawn - traced).max(axis=-1) < 1e-3).mean() > 0.99
    assert (np.abs(drawn - bent).max(axis=-1) > 1e-2).mean() > 0.05


@pytest.mark.parametrize("kind", RENDERERS)
def test_pixels_without_a_ray_are_black(kind):
    camera = lens_camera(atra.OpenCVLens(k1=-0.6), PLACED)
    blind = ~camera.has_ray()
    image = picture(kind, BOX, camera, 2, jitter="off")
    assert np.isfinite(image).all()
    assert (image[blind] == 0.0).all()
    assert blind.any()
    assert (image[~blind] > 0.0).any()


RADIUS, FOCUS = 0.5, 2.0


def seen_from_above(kind, depth, half, **options):
    """A square lamp around the axis of a camera that looks down on it; (image, distances of pixels' centres from the
    axis, on a plane of depth 1)."""
    lamp = light.Scene(quads([floor(half, -depth)]), [light.Emissive((3.0, 2.0, 1.0))], sky=BLACK)
    looks = {"up": (0, 0, -1), "width": 48, "height": 48}
    if kind is atra.Camera:
        camera, pitch = atra.Camera((0, 0, 0), (0, -1, 0), fov_y_degrees=40, **looks), 2 * np.tan(np.radians(20)) / 48
    else:
        camera, pitch = atra.OrthographicCamera((0, 0, 0), (0, -1, 0), view_height=2.4, **looks), 2.4 / 48
    y, x = (np.mgrid[:48, :48] - 23.5) * pitch
    options = {"aperture_radius": RADIUS, "focus_distance": FOCUS} | options
    return picture(light.PathRenderer, lamp, camera, 2048, bounces=0, lights="found", **options), np.hypot(x, y), pitch


@pytest.mark.parametrize(("kind", "depth", "radius"), [
    (atra.Camera, 2 * FOCUS, RADIUS / (2 * FOCUS)), (atra.Camera, FOCUS / 2, RADIUS / FOCUS),
    (atra.OrthographicCamera, 2 * FOCUS, RADIUS),
])  # fmt: skip
def test_a_small_lamp_out_of_focus_is_an_even_disk_as_large_as_its_circle_of_confusion(kind, depth, radius):
    """radius: r |1 / focus - 1 / depth|, and that times the depth where rays are parallel."""
    half = 0.08
    image, distance, pitch = seen_from_above(kind, depth, half)
    rim = 2**0.5 * (half * radius / RADIUS / abs(depth / FOCUS - 1) + pitch)  # half a lamp and half a pixel, at most
    share = (2 * half) ** 2 / (np.pi * (RADIUS * abs(1 - depth / FOCUS)) ** 2)  # of the disk that the lamp covers
    inside = distance < radius - rim
    assert inside.sum() > 50
    np.testing.assert_allclose(image[inside].mean(axis=0), share * np.array([3.0, 2.0, 1.0]), rtol=0.03)
    parts = [image[inside & side].mean() for side in np.indices((48, 48)) < 24]
    np.testing.assert_allclose(parts, image[inside].mean(), rtol=0.05)
    assert (image[distance > radius + rim] == 0.0).all()


def test_a_lamp_in_focus_is_as_sharp_as_through_a_pinhole():
    sharp, blurred = (seen_from_above(atra.Camera, depth, 0.4)[0] for depth in (FOCUS, 2 * FOCUS))
    pinhole = seen_from_above(atra.Camera, FOCUS, 0.4, aperture_radius=0.0, jitter="pixel")[0]
    np.testing.assert_allclose(sharp, pinhole, atol=0.1)
    assert np.abs(blurred - pinhole).max() > 1.0
    np.testing.assert_array_equal(np.isin(sharp, (0.0, 1.0, 2.0, 3.0)), np.isin(pinhole, (0.0, 1.0, 2.0, 3.0)))


def test_an_aperture_is_refused_with_a_lens_and_changes_a_picture_by_update():
    camera = lens_camera(atra.OpenCVLens(k1=-0.3), PLACED)
    told = r"aperture_radius is 0.1, but the camera has the lens OpenCVLens.*expected a pinhole"
    with pytest.raises(atra.InputError, match=told):
        light.PathRenderer(BOX, camera, aperture_radius=0.1)
    with light.PathRenderer(BOX, PLACED, threads=1) as renderer:
        renderer.add(2)
        pinhole = renderer.image
        renderer.update(aperture_radius=0.1, focus_distance=2.0)
        with pytest.raises(atra.InputError, match=told):
            renderer.look(camera)
        assert renderer.samples == 0
        renderer.add(2)
        assert np.abs(renderer.image - pinhole).max() > 0.1
        blurred = renderer.image
    options = {"aperture_radius": 0.1, "focus_distance": 2.0}
    np.testing.assert_array_equal(blurred, picture(light.PathRenderer, BOX, PLACED, 2, **options))
