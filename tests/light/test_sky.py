"""Panoramas: interpolated between the middles of texels, turned, and found alike by aimed and by scattered rays."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from atra import light
from atra.light.emitters.sky_kernels import sky_density, sky_direction
from atra.light.emitters.tables import emitters_of
from tests.baked import baked, sheet, standard_error
from tests.meshes import quads
from tests.shown import batches, down, floor, hybrid, sphere, traced

DRAW = np.random.default_rng(5)
TEXELS = DRAW.random((6, 12, 3), np.float32) ** 4


def looked_up(texels, ways, degrees=0.0):
    """(N, 3): a panorama in the directions of (N, 3) unit vectors, by plain arithmetic."""
    rows, columns = texels.shape[:2]
    turn = np.arctan2(ways[:, 0], -ways[:, 2]) / (2 * np.pi) + 0.5 + degrees / 360
    y, x = np.arccos(ways[:, 1]) / np.pi * rows - 0.5, turn * columns - 0.5
    found = 0.0
    for row, column in np.ndindex(2, 2):
        at = np.clip(np.floor(y).astype(int) + row, 0, rows - 1), (np.floor(x).astype(int) + column) % columns
        weight = np.abs(1 - row - y % 1) * np.abs(1 - column - x % 1)
        found = found + weight[:, None] * texels[at]
    return found


@pytest.mark.parametrize("degrees", [0.0, 100.0, -37.0])
def test_a_wall_has_the_light_of_the_interpolated_panorama_before_it(degrees):
    texels = np.zeros((6, 12, 3), np.float32)
    texels[1, 8], texels[3, 9], texels[0, 0] = (1, 2, 3), (9, 4, 1), 5
    t, s = (np.mgrid[:300, :600] + 0.5).reshape(2, -1) / ((300,), (600,))
    around, down_ = 2 * np.pi * (s - 0.5), np.pi * t
    ways = np.stack([np.sin(down_) * np.sin(around), np.cos(down_), -np.sin(down_) * np.cos(around)], axis=1)
    weights = np.maximum(ways[:, 0], 0) * np.sin(down_) * 2 * np.pi / len(t)
    expected = weights @ looked_up(texels, ways, degrees)
    wall = quads([[(0, -1, 1), (0, -1, -1), (0, 1, -1), (0, 1, 1)]])
    scene = light.Scene.plain(wall, 1.0, sky=light.PanoramaSky(texels, 1.0, degrees))
    lightmap = baked(scene, sheet(scene.mesh, 8), 1024)
    error = 4 * standard_error(lightmap).mean() / 8
    np.testing.assert_allclose(lightmap.environment.mean(axis=0), expected, atol=error)
    assert error < 0.02 * expected.mean()


def test_directions_are_chosen_as_often_as_their_density_says():
    emitters = emitters_of(light.Scene.plain(quads([floor()]), 0.5, sky=light.PanoramaSky(TEXELS + 0.02)))
    turn = 0.3

    @numba.njit
    def directions(densities, texels, numbers):
        found = np.empty((len(texels), 4))
        for k in range(len(texels)):
            way = sky_direction(*densities.shape, texels[k], numbers[k, 0], numbers[k, 1], turn)
            found[k, 0], found[k, 1], found[k, 2] = way
            found[k, 3] = sky_density(densities, way, turn)
        return found

    shares = emitters.sky_densities.ravel() / emitters.sky_densities.sum(dtype=float)
    texels = DRAW.choice(len(shares), 200_000, p=shares / shares.sum())
    found = directions(emitters.sky_densities, texels, DRAW.random((len(texels), 2), np.float32))
    np.testing.assert_allclose(np.linalg.norm(found[:, :3], axis=1), 1, rtol=1e-6)
    octant = (found[:, :3] > 0) @ (1, 2, 4)
    for number in range(8):  # the solid angle of each, an eighth of the sphere's
        of_one = (octant == number) / found[:, 3]
        assert abs(of_one.mean() - np.pi / 2) < 4 * of_one.std() / np.sqrt(len(texels))
        assert of_one.std() / np.sqrt(len(texels)) < 0.02


@pytest.mark.parametrize("shape", [(1, 1, 3), (3, 5, 3), (8, 16, 3)])
def test_in_a_sky_of_one_colour_a_ball_has_its_albedo_times_that(shape):
    ball = sphere(light.Lambertian((0.8, 0.5, 0.2)), light.PanoramaSky(np.full(shape, 2.0, np.float32)), segments=8)
    found = batches(ball, down(8, fov=16), 8, 64, bounces=1, jitter="pixel").mean(axis=(1, 2))
    np.testing.assert_allclose(found.mean(axis=0), (1.6, 1.0, 0.4), rtol=5e-3)


def test_a_panorama_turned_by_a_quarter_is_the_one_whose_columns_are_rolled_by_a_quarter():
    turned, rolled = light.PanoramaSky(TEXELS, 1.0, 90.0), light.PanoramaSky(np.roll(TEXELS, -3, axis=1))
    mirror, ball = sphere(light.Metal((1, 1, 1)), turned), sphere(light.Lambertian(0.7), turned)
    camera = down(16)
    for draw in (lambda one: traced(one, camera, 1, jitter="off"), lambda one: hybrid(one, camera, 1).image):
        one, other, before = (
            draw(replace(mirror, sky=sky)) for sky in (turned, rolled, replace(turned, rotation_degrees=0.0))
        )
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-5)
        assert np.abs(one - before).max() > 0.1
    one, other = (batches(replace(ball, sky=sky), camera, 8, 64, bounces=1) for sky in (turned, rolled))
    error = np.sqrt((one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / 8)
    assert (np.abs(one.mean(axis=0) - other.mean(axis=0)) <= 6 * error + 1e-6).all()


def test_a_positive_rotation_turns_the_sky_counterclockwise_seen_from_above():
    texels = np.zeros((4, 8, 3), np.float32)
    texels[:, 3:5] = 1.0  # straight ahead, along -z
    scene = light.Scene(quads([floor(0.01, -9.0)]), sky=light.PanoramaSky(texels, rotation_degrees=90.0))
    for target, radiance in (((-1, 0, 0), 1.0), ((0, 0, -1), 0.0), ((1, 0, 0), 0.0)):
        camera = replace(down(1), eye=(0, 0, 0), target=target, up=(0, 1, 0), fov_y_degrees=1.0)
        np.testing.assert_allclose(traced(scene, camera, 1, jitter="off")[0, 0], radiance, atol=1e-5)
