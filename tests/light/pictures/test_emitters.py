"""Rays aimed at lamps and at a panorama: closed forms, densities, and the same mean as by scattering alone."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from scenes.lit.rooms import lit_cornell_box
from scenes.scene import upright_camera
from tests.meshes import cornell_camera, quads
from tests.shown import BLACK, batches, down, floor, floor_points, sphere, traced


def panorama(rows=8, columns=16, sun=400.0):
    """Dim, random, with one bright texel above the horizon."""
    texels = np.random.default_rng(0).random((rows, columns, 3)).astype(np.float32)
    texels[2, 5] = sun
    return light.PanoramaSky(texels)


def under_a_lamp(half, height):
    """A grey floor, and a square lamp whose front faces down."""
    mesh = quads([floor(), floor(half, height)[::-1]])
    return light.Scene(mesh, [light.Lambertian(0.5), light.Emissive((3.0, 2.0, 1.0))], [0, 0, 1, 1], sky=BLACK)


def test_a_floor_is_lit_as_much_as_a_square_lamp_fills_of_its_view():
    half, height, beside = 0.25, 2.0, 0.5
    scene = under_a_lamp(half, height)
    camera = replace(down(4, eye=(beside, 1.0, 0), fov=2))
    image = traced(scene, camera, 256, bounces=1)
    points = floor_points(camera)
    grid = (np.arange(64) + 0.5) / 64 * 2 * half - half
    way = np.stack(np.meshgrid(grid, grid), -1)[None, None] - points[..., None, None, ::2]
    squared = (way**2).sum(-1) + height**2
    form = (height**2 / squared**2).mean((2, 3)) * (2 * half) ** 2 / np.pi  # cos cos / (pi r^2)
    expected = 0.5 * form[..., None] * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(image, expected, rtol=0.01)


def test_a_lamp_shines_to_its_front_alone_and_is_shadowed():
    turned = quads([floor(), floor(0.5, 2.0)])
    scene = light.Scene(turned, [light.Lambertian(0.5), light.Emissive()], [0, 0, 1, 1], sky=BLACK)
    assert (traced(scene, down(4, eye=(0, 1, 0)), 16, bounces=1) == 0).all()
    screen = quads([floor(), floor(0.5, 2.0)[::-1], floor(1.0, 1.5)])
    shadowed = light.Scene(screen, [light.Lambertian(0.5), light.Emissive()], [0, 0, 1, 1, 0, 0], sky=BLACK)
    assert (traced(shadowed, down(4, eye=(0, 1, 0), fov=20), 16, bounces=1) == 0).all()


def beside_a_lamp():
    return lit_cornell_box(), cornell_camera(12, 12)


def smooth_under_a_panorama():
    ball = sphere(light.Lambertian((0.7, 0.5, 0.3)), panorama(), segments=8)
    return ball, atra.Camera((0, 0.5, 4), (0, 0, 0), fov_y_degrees=40, width=12, height=12)


def lamp_and_panorama():
    corners = [floor(20.0), floor(0.4, 1.5)[::-1], [(-2, 0, -1), (2, 0, -1), (2, 3, -1), (-2, 3, -1)]]
    materials = [light.Lambertian(0.6), light.Emissive(8.0), light.Metal(0.9, 0.2)]
    scene = light.Scene(quads(corners), materials, [0, 0, 1, 1, 2, 2], sky=panorama())
    return scene, atra.Camera(**upright_camera((1.0, 2.0, 5.0), (0.0, 0.7, 0.0), 40.0), width=12, height=12)


@pytest.mark.parametrize("make", [beside_a_lamp, smooth_under_a_panorama, lamp_and_panorama])
def test_both_ways_to_find_light_have_one_mean_and_aiming_has_less_noise(make):
    scene, camera = make()
    aimed = batches(scene, camera, 16, 16, bounces=3, jitter="pixel").mean(axis=(1, 2))
    found = batches(scene, camera, 16, 256, bounces=3, jitter="pixel", lights="found").mean(axis=(1, 2))
    error = np.sqrt((aimed.var(axis=0, ddof=1) + found.var(axis=0, ddof=1)) / 16)
    assert (np.abs(aimed.mean(axis=0) - found.mean(axis=0)) < 4 * error).all()
    assert (error < 0.05 * found.mean(axis=0)).all()
    assert aimed.std() < 2 * found.std()  # with a sixteenth of the samples: half the noise at least


def test_without_emitters_nothing_is_aimed_and_the_rays_are_the_same():
    scene = light.Scene(quads([floor()]), [light.Lambertian(0.5)])
    with (
        light.PathRenderer(scene, down(8), threads=1) as aimed,
        light.PathRenderer(scene, down(8), threads=1, lights="found") as found,
    ):
        aimed.add(2)
        found.add(2)
        assert aimed.ray_count == found.ray_count
        np.testing.assert_array_equal(aimed.image, found.image)
