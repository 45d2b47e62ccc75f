"""Pictures against Mitsuba 3's of the same triangles and materials: tile by tile, by a test of means."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from experiments.light.mitsuba_light import mitsuba_scene
from scenes.atrium import ATRIUM_CAMERA, atrium
from scenes.lit.weekend import WEEKEND_CAMERA, outwards, weekend
from scenes.shapes import ball
from tests.meshes import cornell_box, cornell_camera, joined, quads
from tests.shown import batches, floor

if importlib.util.find_spec("mitsuba") is None:
    pytest.skip("Mitsuba 3 is not installed (extra `peers`)", allow_module_level=True)

BATCHES, SAMPLES, TILE, DEPTH = 8, 16, 8, 4


def of_mitsuba(scene, camera):
    """(BATCHES, H, W, 3), each of SAMPLES samples, its seed its number."""
    mi = pytest.importorskip("mitsuba")
    mi.set_variant("scalar_rgb")
    loaded = mitsuba_scene(mi, scene, camera, DEPTH)
    return np.array([np.array(mi.render(loaded, spp=SAMPLES, seed=seed)) for seed in range(BATCHES)], float)


def cornell():
    mesh = cornell_box()
    materials = [
        light.Lambertian((0.73, 0.7, 0.65)), light.Lambertian((0.65, 0.05, 0.05)),
        light.Lambertian((0.12, 0.45, 0.15)), light.Emissive((9.0, 8.0, 6.0)), light.Metal((0.9, 0.8, 0.7)),
    ]  # fmt: skip
    numbers = np.zeros(mesh.triangle_count, int)
    numbers[6:8], numbers[8:10], numbers[10:12], numbers[24:] = 1, 2, 3, 4
    return light.Scene(mesh, materials, numbers, sky=light.constant_sky((0.2, 0.3, 0.4))), cornell_camera(32, 32)


def three_balls():
    one = outwards(ball(1.0, 24, 12))
    balls = [one.moved(x=x, y=1.0).to_mesh("ball") for x in (-2.1, 0.0, 2.1)]
    mesh = joined(quads([floor(8.0)]), *balls)
    numbers = np.repeat([0, 1, 2, 3], [2, *(part.triangle_count for part in balls)])
    materials = [
        light.Lambertian((0.5, 0.6, 0.3)), light.Lambertian((0.4, 0.2, 0.1)), light.Dielectric(1.5),
        light.Metal((0.7, 0.6, 0.5)),
    ]  # fmt: skip
    scene = light.Scene(mesh, materials, numbers, sky=light.constant_sky((0.5, 0.7, 1.0)))
    return scene, atra.Camera((3, 2.5, 6), (0, 0.8, 0), fov_y_degrees=40, width=48, height=32)


def book():
    """The weekend's scene without fuzz, chequers and a sky of two colours, which Mitsuba's plain materials have not."""
    scene = weekend(segments=8)
    plain = [light.Lambertian((0.5, 0.6, 0.5)), *scene.materials[1:]]
    plain = [light.Metal(one.colour) if isinstance(one, light.Metal) else one for one in plain]
    shown = replace(scene, materials=plain, sky=light.constant_sky((0.6, 0.7, 1.0)), normals=None, uv=None, lights=())
    return shown, atra.Camera(**WEEKEND_CAMERA, width=48, height=32)


def hall():
    """The atrium, whose upper parts shine."""
    mesh = atrium()
    heights = mesh.vertices[mesh.faces][:, :, 1].mean(axis=1)
    is_high = heights > 0.55 * heights.max()
    materials = [light.Lambertian((0.7, 0.6, 0.5)), light.Emissive((1.0, 0.9, 0.8))]
    scene = light.Scene(mesh, materials, is_high.astype(int), sky=light.constant_sky(0.0))
    return scene, atra.Camera(**ATRIUM_CAMERA, width=32, height=24)


def tiles(pictures):
    """Means of the tiles of each picture, (BATCHES, tiles, 3)."""
    count, height, width, _ = pictures.shape
    cut = pictures.reshape(count, height // TILE, TILE, width // TILE, TILE, 3)
    return cut.mean(axis=(2, 4)).reshape(count, -1, 3)


@pytest.mark.parametrize("make", [cornell, three_balls, book, hall])
def test_no_tile_differs_from_mitsuba_s_more_than_chance_allows(make):
    from scipy import stats

    scene, camera = make()
    ours = tiles(batches(scene, camera, BATCHES, SAMPLES, bounces=DEPTH - 1, jitter="pixel"))
    theirs = tiles(of_mitsuba(scene, camera))
    noisy = (ours.std(axis=0) > 1e-5) | (theirs.std(axis=0) > 1e-5)  # the others show the sky alone
    np.testing.assert_allclose(ours.mean(axis=0)[~noisy], theirs.mean(axis=0)[~noisy], rtol=1e-5)
    assert noisy.mean() > 0.7
    chance = stats.ttest_ind(ours[:, noisy], theirs[:, noisy], equal_var=False).pvalue
    significance = 1 - (1 - 0.01) ** (1 / chance.size)  # Šidák
    assert chance.min() > significance
    error = np.sqrt((ours.mean(axis=1).var(axis=0, ddof=1) + theirs.mean(axis=1).var(axis=0, ddof=1)) / BATCHES)
    assert (np.abs(ours.mean(axis=(0, 1)) - theirs.mean(axis=(0, 1))) < 4 * error + 1e-6).all()
    darker = 0.9 * ours[:, noisy]
    assert stats.ttest_ind(darker, theirs[:, noisy], equal_var=False).pvalue.min() < significance  # it would be seen
