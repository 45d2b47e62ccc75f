"""What lit texels go through before they are files: denoising, views, and maps of which each knows its own alone."""

import importlib.util
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra import light as render
from atra.errors import InputError
from atra.light import (
    Atlas,
    Baker,
    Lightmap,
    Seams,
    Texels,
    clay_view,
    denoised,
    dilated,
    lit_view,
    save_maps,
    save_model,
)
from atra.light.lightmaps.paths_kernels import LUMINANCE
from atra.light.pictures.files import srgb_of
from tests.baked import baked, cube, looked_up, painted, sheet
from tests.images import draw
from tests.light.lightmaps.test_bake_charts import folded
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


BOX = cube(inwards=True)
SCENE = painted(BOX, 0.5, lights=[render.PointLight((0.3, 0.4, 0.1))], sky=render.constant_sky(0.5))
SIDES = np.arange(12) // 2
CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def whole_maps(mesh, texels, map_of):
    """Every quadrilateral fills all of the map that it is on."""
    uv = [CORNERS[list(face)] for _ in range(mesh.triangle_count // 2) for face in ((0, 1, 2), (0, 2, 3))]
    return Atlas.of_uv(np.array(uv), texels, texels, map_of)


def six_maps(texels=6):
    return whole_maps(BOX, texels, SIDES)


def test_light_is_the_same_whichever_map_a_chart_is_on():
    whole = baked(SCENE, six_maps(), 256)
    assert (whole.texels.map_of == whole.texels.chart).all()
    assert (np.bincount(whole.texels.map_of) == 36).all()
    other = baked(SCENE, sheet(BOX, 6), 256)
    for side in range(6):
        here, there = (one.luminance[one.texels.prim_id // 2 == side].mean() for one in (whole, other))
        assert here == pytest.approx(there, rel=0.05)


def test_texels_at_the_rims_of_two_maps_are_no_neighbours_and_on_one_map_they_are():
    two = quads([floor(0.5), floor(0.5, 1.0)])
    with warnings.catch_warnings(action="error"):
        Texels.of(two, whole_maps(two, 8, np.array([0, 0, 1, 1])))
    touching = Atlas(whole_maps(two, 8, np.array([0, 0, 1, 1])).uv, np.array([0, 0, 1, 1]), 8, 16)
    with pytest.warns(UserWarning, match="belong to different charts"):
        Texels.of(two, touching)


def test_gutters_and_look_ups_take_nothing_from_another_map():
    mesh = folded()
    atlas = whole_maps(mesh, 8, np.array([0, 0, 1, 1]))
    texels = Texels.of(mesh, atlas)
    light = np.where(texels.map_of == 0, 1.0, 2.0).astype(np.float32)[:, None].repeat(3, axis=1)
    valid = np.arange(len(texels)) % 3 == 0
    image = dilated(texels, light, valid)
    assert (image[:8] == 1).all()
    assert (image[8:] == 2).all()
    none = dilated(texels, light, valid & (texels.map_of == 0))
    assert (none[:8] == 1).all()
    assert not none[8:].any()
    camera = atra.Camera((0, 3, 0), (0, 0, 0), (0, 0, 1), 60, width=64, height=64)
    hits = draw(mesh, camera)
    shown = looked_up(hits, atlas, image)[..., 0]
    np.testing.assert_array_equal(shown[hits.hit], np.where(hits.prim_id[hits.hit] < 2, 1, 2))
    seams = Seams.of(mesh, atlas)
    assert seams.texel.shape[1] > 0
    np.testing.assert_allclose(seams.values(image)[..., 0].T, [[1, 2]] * seams.texel.shape[1])
    stitched = seams.stitched(image)
    assert seams.step(stitched) < 0.25 * seams.step(image)


def test_of_the_maps_that_a_view_shows_the_least_converged_comes_first():
    with Baker(SCENE, six_maps(), threads=1) as baker:
        baker.look(atra.Camera((0, 0, 0), (1, 0.2, 0.1), fov_y_degrees=110, width=32, height=32))
        on_map, seen = baker.texels.map_of, baker.visible
        shown = np.unique(on_map[seen])
        assert len(shown) > 1
        for turn in range(2):
            for number, which in enumerate(shown):
                assert baker.advance(64)
                done = np.unique(on_map[baker.samples == 16 * (turn + 1)])
                assert done.tolist() == shown[: number + 1].tolist(), "one map at a time, the first of several"
                assert (baker.samples[seen & (on_map == which)] == 16 * (turn + 1)).all()
                assert not baker.samples[~seen].any()
        while baker.advance(64):
            pass
        assert baker.share_done(64) == 1.0
        light = baker.maps.combined
    np.testing.assert_array_equal(light, baked(SCENE, six_maps(), 64).combined)


def test_each_map_has_files_of_its_own_and_the_model_shows_all(tmp_path):
    pytest.importorskip("OpenEXR", reason="OpenEXR is not installed (extra `bake`)")
    lightmap = baked(SCENE, whole_maps(BOX, 8, SIDES), 16)
    names = {path.name for path in save_maps(lightmap, tmp_path, visible=lightmap.valid)}
    assert {f"combined_{number}.exr" for number in range(6)} | {"culling_map_5.png", "charts_0.png"} <= names
    assert np.asarray(Image.open(tmp_path / "combined_0.png")).shape == (8, 8, 3)
    path = save_model(lightmap, SCENE, tmp_path / "scene.glb", exposure=0.0, tone="none")
    shown = trimesh.load(path).geometry
    assert len(shown) == 6
    for number in range(6):
        model = shown[f"scene_{number}"]
        np.testing.assert_allclose(model.triangles, BOX.triangles(np.arange(12)[number == SIDES]), atol=1e-6)
        np.testing.assert_allclose(model.visual.uv.reshape(2, 3, 2), CORNERS[[[0, 1, 2], [0, 2, 3]]], atol=1e-6)
        image = np.asarray(model.visual.material.baseColorTexture.convert("RGB"))
        here = lightmap.texels.map_of == number
        place = lightmap.texels.number[here] - 64 * number
        expected = srgb_of(0.5 * lightmap.combined[here]).astype(int)
        assert np.median(np.abs(image.reshape(-1, 3)[place] - expected)) <= 1  # all but seams, which are matched


@pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")
def test_charts_of_a_wanted_size_take_as_many_maps_as_they_need(tmp_path):
    mesh = cube()
    one, several = (Atlas.unwrap(mesh, 64, texels_per_unit=rate, kept_in=tmp_path) for rate in (4.0, 20.0))
    assert (one.maps, one.width, one.height) == (1, 64, 64)
    assert several.maps > 1
    assert (several.width, several.map_height, several.height) == (64, 64, 64 * several.maps)
    for atlas, rate in ((one, 4.0), (several, 20.0)):
        size = np.linalg.norm(np.diff(atlas.uv, axis=1), axis=2).max()
        assert size == pytest.approx(np.sqrt(8) * rate, rel=0.05)
        texels = Texels.of(mesh, atlas)
        assert set(texels.map_of.tolist()) == set(range(atlas.maps))
        assert texels.faces_lost == 0
    again = Atlas.unwrap(mesh, 64, texels_per_unit=20.0, kept_in=tmp_path)
    assert again.maps == several.maps
    np.testing.assert_array_equal(again.uv, several.uv)
