"""Panoramas: interpolated between the middles of texels, turned, seen, mirrored and as light."""

import numpy as np
import pytest

import atra
from atra import light
from tests.baked import baked, sheet, standard_error
from tests.meshes import quads
from tests.shown import batches, down, floor, picture, sphere


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


@pytest.mark.parametrize("shape", [(1, 1, 3), (3, 5, 3), (8, 16, 3)])
def test_in_a_sky_of_one_colour_a_ball_has_its_albedo_times_that(shape):
    ball = sphere(light.Lambertian((0.8, 0.5, 0.2)), light.PanoramaSky(np.full(shape, 2.0, np.float32)), segments=8)
    found = batches(ball, down(8, fov=16), 8, 64, bounces=1, jitter="pixel").mean(axis=(1, 2))
    np.testing.assert_allclose(found.mean(axis=0), (1.6, 1.0, 0.4), rtol=5e-3)


@pytest.mark.parametrize("kind", [light.PathRenderer, light.HybridRenderer])
@pytest.mark.parametrize("degrees", [0.0, 90.0, -37.0])
def test_a_panorama_is_seen_and_mirrored_where_its_texels_point_without_steps(kind, degrees):
    """Row 0 is above, the middle column along -z; a turn is counterclockwise seen from above."""
    texels = np.random.default_rng(2).random((8, 16, 3), np.float32)
    scene = light.Scene(quads([floor(50.0)]), [light.Metal((1, 1, 1))], sky=light.PanoramaSky(texels, 2.0, degrees))
    for target in ((0, 2.5, -1), (1, 1.5, 0.5)):
        camera = atra.Camera((0, 2, 0), target, fov_y_degrees=60, width=32, height=32)
        ways = camera.rays_world()[1].reshape(-1, 3)
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        if kind is light.PathRenderer:  # hybrid frames mirror no sky
            ways[:, 1] = np.abs(ways[:, 1])
        is_sky = ways[:, 1] > 0.05
        image = picture(kind, scene, camera, 1, jitter="off").reshape(-1, 3)
        expected = 2.0 * looked_up(texels, ways, degrees)
        assert is_sky.sum() > 60
        np.testing.assert_allclose(image[is_sky], expected[is_sky], rtol=1e-4, atol=2e-4)
