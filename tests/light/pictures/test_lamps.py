"""Paths lit by lamps without extent, and surfaces with holes."""

from dataclasses import replace

import numpy as np
import pytest

from atra import light
from scenes.lit.rooms import lit_cornell_box
from tests.meshes import cornell_camera, quads
from tests.shown import BLACK, down, floor, floor_points, picture, traced

ABOVE = down(4, eye=(0.3, 1.0, 0), fov=2)
LAMPS = [
    light.Sun((0.0, -1.0, 0.0), 0.0, power=2.0), light.PointLight((0, 2, 0), power=3.0),
    light.SphereLight((0, 2, 0), 0.01, power=3.0), light.SpotLight((0, 2, 0), (0, -1, 0), 40.0, 50.0, power=3.0),
]  # fmt: skip


def received(lamp, points):
    """What a white floor shows of a lamp above it."""
    if isinstance(lamp, light.Sun):
        return np.full(points.shape[:2], lamp.power)
    way = np.array(lamp.position) - points
    squared = (way**2).sum(-1)
    return lamp.power * way[..., 1] / squared**1.5


@pytest.mark.parametrize("lamp", LAMPS, ids=lambda lamp: type(lamp).__name__)
def test_a_floor_shows_a_lamp_as_the_inverse_square_and_the_cosine_say(lamp):
    scene = light.Scene(quads([floor()]), [light.Lambertian(0.5)], lights=[lamp], sky=BLACK)
    image = traced(scene, ABOVE, 8, bounces=1)
    expected = 0.5 * received(lamp, floor_points(ABOVE))
    np.testing.assert_allclose(image[..., 0], expected, rtol=2e-3)


def test_of_many_lamps_each_is_counted_once():
    lamps = [light.PointLight((x, 1.5, z), power=1.0 + x * x) for x in range(-3, 4) for z in range(-3, 4)]
    scene = light.Scene(quads([floor()]), [light.Lambertian(0.5)], lights=lamps, sky=BLACK)
    image = traced(scene, ABOVE, 512, bounces=1)
    expected = 0.5 * sum(received(lamp, floor_points(ABOVE)) for lamp in lamps)
    np.testing.assert_allclose(image[..., 0].mean(), expected.mean(), rtol=0.01)


def half_open(alpha, opacity=0.4):
    """A floor beneath a pane that holds light off in part."""
    pane = light.MetallicRoughness((0.0, 0.0, 0.0), opacity, alpha, roughness=1.0)
    mesh = quads([floor(), floor(1.0, 1.5)])
    return light.Scene(mesh, [light.Lambertian(0.5), pane], [0, 0, 1, 1], [light.Sun((0, -1, 0), 0.0)], BLACK)


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
@pytest.mark.parametrize(("alpha", "share"), [("opaque", 0.0), ("mask", 1.0), ("blend", 0.6)])
def test_the_eye_and_light_pass_holes_and_in_part_what_is_blended(kind, alpha, share):
    scene, options = half_open(alpha), {"bounces": 1} if kind is light.PathRenderer else {"occlusion_rays": 0}
    np.testing.assert_allclose(picture(kind, scene, ABOVE, 64, **options), 0.5 * share, rtol=1e-4)
    above = picture(kind, scene, replace(ABOVE, eye=(0.3, 3.0, 0)), 256, **options)
    dark = 0.04 * 0.25  # what the black pane mirrors at most of the sun, rough as it is
    np.testing.assert_allclose(above.mean(), 0.5 * share * share, atol=dark + 0.02)


def test_a_textured_emitter_lights_as_much_as_scattering_finds():
    texels = np.zeros((4, 4, 3), np.uint8)
    texels[:2, :2] = 255
    glow = light.MetallicRoughness((0, 0, 0), emission=(4.0, 4.0, 4.0), emission_image=light.Image(texels))
    mesh = quads([floor(), floor(1.0, 1.5)[::-1]])
    uv = np.tile([[0, 0], [1, 0], [1, 1], [0, 1]], (2, 1)).astype(np.float32)
    scene = light.Scene(mesh, [light.Lambertian(0.5), glow], [0, 0, 1, 1], sky=BLACK, uv=uv)
    aimed, found = (traced(scene, ABOVE, 1024, bounces=1, lights=way).mean() for way in ("aimed", "found"))
    assert aimed == pytest.approx(found, rel=0.03)
    assert aimed > 0.01


def test_roulette_changes_no_mean():
    scene, camera = lit_cornell_box(), cornell_camera(16, 16)
    short, long = (traced(scene, camera, 256, bounces=11, roulette_from=rays).mean() for rays in (1, 100))
    assert short == pytest.approx(long, rel=0.02)
