"""What lit texels go through before they are a file: denoising, views, and what they must not touch."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from atra.errors import InputError
from atra.light import Lightmap, Texels, clay_view, denoised, lit_view
from atra.light.lightmaps.paths_kernels import LUMINANCE
from tests.baked import baked, cube, looked_up, painted, sheet
from tests.images import draw
from tests.meshes import quads
from tests.shown import floor

NOISE = 0.25
"""Variance of `noisy` light, of each colour."""


def noisy(count, seed):
    """(N, 3), light whose mean is 1."""
    return np.random.default_rng(seed).gamma(1 / NOISE, NOISE, (count, 3)).astype(np.float32)


def of_light(texels, light, noise=NOISE, samples=16):
    """A map of texels with this direct light, (N, 3), of so much variance, and no other."""
    count = len(texels)
    nothing, whole = np.zeros((count, 3), np.float32), np.ones(count, np.float32)
    of_one = whole * np.float32(samples * noise * np.square(LUMINANCE).sum())
    return Lightmap(
        texels, np.full(count, samples, np.int32), light, nothing, nothing, whole, np.zeros(count, np.float32), of_one,
        np.stack([of_one, 2 * of_one], axis=1) / samples,
    )  # fmt: skip


def test_without_the_package_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    mesh = quads([floor(0.5)])
    texels = Texels.of(mesh, sheet(mesh, 4))
    with pytest.raises(InputError, match=r"^denoising needs the package pyoidn, .*pip install -e '\.\[denoise\]'$"):
        denoised(of_light(texels, np.ones((len(texels), 3), np.float32)))


def two_charts(texels, gap):
    """Two squares side by side in the map, and which texels are the second's."""
    mesh = quads([floor(0.5), floor(0.5, 1.0)])
    found = Texels.of(mesh, sheet(mesh, texels, gap))
    return found, found.chart == 1


def test_denoising_takes_noise_and_nothing_of_a_white_chart_leaks_into_a_black_one_beside_it():
    pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    texels, black = two_charts(32, 2)
    light = np.where(black[:, None], 0, noisy(len(texels), 1))
    clean = denoised(of_light(texels, light), 1)
    assert not clean.combined[black].any()
    white = clean.combined[~black]
    assert white.mean() == pytest.approx(1.0, abs=0.05)
    assert white.std() < 0.25 * light[~black].std()
    np.testing.assert_array_equal(denoised(of_light(texels, light), 1).combined, clean.combined)


@pytest.mark.parametrize(("samples", "kept"), [(16, True), (1, False)])  # one sample tells no variance
def test_light_that_is_no_noise_by_its_variance_is_given_back(samples, kept):
    pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    texels, second = two_charts(32, 2)
    light = noisy(len(texels), 3)
    sharp, blurred = (
        denoised(of_light(texels, light, variance, samples), 1).combined[second] for variance in (1e-6, NOISE)
    )
    assert (np.abs(sharp - light[second]).max() < 1e-3) == kept
    assert blurred.std() < 0.25 * light[second].std()


def test_denoising_leaves_alone_what_has_no_light_to_be_known_of():
    pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    texels, second = two_charts(8, 3)
    light = noisy(len(texels), 2)
    backs = second.astype(np.float32)  # it lies inside of something
    given = replace(of_light(texels, light), backs=backs)
    clean = denoised(given, 1)
    np.testing.assert_array_equal(clean.direct[second], light[second])
    assert (clean.direct[~second] != light[~second]).any()
    for name in ("samples", "openness", "backs", "variance"):
        np.testing.assert_array_equal(getattr(clean, name), getattr(given, name))
    nothing = replace(given, samples=np.zeros_like(given.samples))
    np.testing.assert_array_equal(denoised(nothing, 1).direct, light)


def test_a_view_shows_albedo_times_map_between_texels_and_lamps_as_they_shine():
    mesh = cube(inwards=True)
    atlas = sheet(mesh, 16)
    emission = np.zeros((12, 3), np.float32)
    emission[2:4] = 0.25  # of the side that the camera looks at
    scene = painted(mesh, 0.5, emission)
    texels = Texels.of(mesh, atlas)
    # A map that is linear in the world is the same looked up between its texels.
    slopes = np.array([0.1, 0.2, 0.3])
    image = texels.image((1 + texels.positions @ slopes).astype(np.float32)[:, None].repeat(3, axis=1))
    camera = atra.Camera((0, 0, 0), (1, 0.3, 0.2), fov_y_degrees=80, width=48, height=32)
    hits = draw(mesh, camera)
    expected = 1 + hits.points @ slopes
    inside = np.abs(np.sort(np.abs(hits.points), axis=2)[..., 1]) < 0.9  # off the rim, where a look-up reads a gutter
    assert inside.mean() > 0.5
    np.testing.assert_allclose(looked_up(hits, atlas, image)[inside, 0], expected[inside], atol=1e-4)
    lamp = np.isin(hits.prim_id, (2, 3))
    assert 0.1 < lamp.mean() < 0.95
    shown = lit_view(hits, scene, atlas, image)
    np.testing.assert_allclose(shown[inside, 1], np.where(lamp, 0.25, 0.5 * expected)[inside], atol=1e-4)
    clay = clay_view(hits)
    assert clay.shape == (32, 48, 3)
    assert len(np.unique(np.rint(100 * clay))) > 2


def test_a_view_of_what_has_no_place_in_the_map_and_of_nothing_is_black():
    mesh = quads([floor(0.5), floor(0.5, 1.0)])
    whole = sheet(mesh, 8)
    atlas = replace(whole, chart=np.where(whole.chart == 1, -1, 0))
    camera = atra.Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), width=32, height=32)
    hits = draw(mesh, camera)
    image = np.ones((whole.height, whole.width, 1), np.float32)
    shown = looked_up(hits, atlas, image)[..., 0]
    np.testing.assert_array_equal(shown, np.isin(hits.prim_id, np.flatnonzero(atlas.chart == 0)).astype(np.float32))


def test_the_error_of_a_map_is_told_by_how_it_changes_and_not_by_the_variance_of_its_samples():
    mesh = quads([floor(0.5)])
    sky = light.GradientSky((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    lightmap = baked(light.Scene.plain(mesh, 0.0, sky=sky), sheet(mesh, 32), 64)
    every = np.arange(len(lightmap.samples))
    true = ((lightmap.luminance - 5 / 6) ** 2).sum()
    assert true / 2.5 < lightmap.squared_error(every) < 2.5 * true
    assert (lightmap.variance / 64).sum() > 4 * true
