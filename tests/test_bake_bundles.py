"""Bundles that carry light: closed forms, the light of a baker, and the same whatever finds their hits."""

from __future__ import annotations

import numpy as np
import pytest

import atra
from atra import render
from atra.bake import BakeScene, LightBundles, Surface, Texels
from atra.errors import InputError
from atra.kernels.baking.tables import LUMINANCE
from tests.baked import baked, cube, sheet, standard_error
from tests.meshes import joined, quads
from tests.shown import floor

BOX = cube(inwards=True)
INNER = atra.Mesh(cube(0.35).vertices + np.float32([0.3, -0.2, 0.1]), cube().faces)
ROOM = joined(BOX, INNER)


def carried(scene, atlas, directions, direct=0.0, make=atra.RasterTracer, **options):
    texels = Texels.of(scene.mesh, atlas)
    bundles = LightBundles(scene, texels, np.broadcast_to(direct, (len(texels), 3)), **options)
    with make(scene.mesh, bundles.camera, threads=1) as tracer:
        bundles.add(tracer, directions)
    return bundles


def test_a_convex_body_in_a_sky_of_one_receives_just_that():
    mesh = cube()
    bundles = carried(BakeScene(mesh, sky=render.constant_sky(1.0)), sheet(mesh, 6), 24, size=64)
    assert bundles.hits.min() > 0
    np.testing.assert_allclose(bundles.environment, 1.0, rtol=1e-6)
    assert bundles.indirect.max() == bundles.rays_cut == 0


def test_a_sky_that_grows_brighter_upwards_comes_from_above():
    plate, sky = quads([floor(0.5)]), render.GradientSky((0.2, 0.4, 1.0), (1.0, 0.5, 0.0), 2.0)
    bundles = carried(BakeScene(plate, Surface.plain(plate, 0.0), sky=sky), sheet(plate, 6), 512, size=32)
    below, above = np.array(sky.below), np.array(sky.above)
    expected = 2.0 * (below + (above - below) * 5 / 6)  # the mean height by the cosine is 2/3
    np.testing.assert_allclose(bundles.environment.mean(axis=0), expected, rtol=0.005)


@pytest.mark.parametrize(("albedo", "bounces"), [(0.5, 4), (0.8, 2)])
def test_a_closed_furnace_has_the_light_of_a_geometric_series(albedo, bounces):
    """Emission comes straight, so 1 is given. Where every line sees the same there is no noise: what is lacking is what
    the first directions could not know, and halves as directions double."""
    scene, atlas = BakeScene(BOX, Surface.plain(BOX, albedo)), sheet(BOX, 6)
    once = carried(scene, atlas, 16, 1.0, size=48, bounces=1)
    assert once.hits.min() > 0
    np.testing.assert_allclose(once.light, 1.0 + albedo, rtol=1e-6)
    expected = (1 - albedo ** (bounces + 1)) / (1 - albedo)
    lacking = [expected - carried(scene, atlas, n, 1.0, size=48, bounces=bounces).light for n in (100, 400)]
    for values, bound in zip(lacking, (0.12, 0.04), strict=True):
        assert values.min() > -1e-5
        assert values.max() < bound * expected
    assert lacking[1].mean() < 0.4 * lacking[0].mean()


def test_a_coloured_room_has_the_light_of_a_baker_in_blocks_of_texels():
    rng = np.random.default_rng(3)
    albedo = np.repeat(rng.uniform(0.2, 0.8, (12, 3)), 2, axis=0)
    emission = np.zeros((24, 3))
    emission[6:8] = 4.0, 3.0, 2.0
    scene = BakeScene(ROOM, Surface.plain(ROOM, albedo, emission), [render.PointLight((-0.6, 0.7, 0.5))])
    atlas = sheet(ROOM, 12)
    expected = baked(scene, atlas, 512)
    direct = baked(scene, atlas, 256, bounces=0, seed=1).direct
    every = [carried(scene, atlas, 256, direct, size=96, seed=seed) for seed in range(4)]
    x, y = expected.texels.number % atlas.width - 2, expected.texels.number // atlas.width - 2
    block = (y // 14 * 4 + x // 14) * 16 + y % 14 // 3 * 4 + x % 14 // 3  # of 3 x 3 texels of a chart
    count = np.bincount(block)
    kept = count == 9

    def mean(values):
        return np.bincount(block, values)[kept] / 9

    light = np.stack([mean(one.light.astype(float) @ LUMINANCE) for one in every])
    got, own_error = light.mean(axis=0), np.sqrt((light.var(axis=0, ddof=1) / len(every)).mean())
    error = np.hypot(np.sqrt(mean(standard_error(expected) ** 2) / 9), own_error)
    assert kept.sum() > 100
    # A texel gives the same light everywhere and the first directions know little: 1.5 % beside the noise.
    assert (np.abs(got - mean(expected.luminance)) < 4.5 * error + 0.015 * got).all()
    assert abs(got.mean() / mean(expected.luminance).mean() - 1) < 0.01
    assert np.mean([one.indirect.mean() for one in every]) > 0.3 * expected.combined.mean()
    for channel in range(3):
        ratio = every[0].indirect[:, channel].mean() / expected.indirect[:, channel].mean()
        assert ratio == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("make", [
    lambda mesh, camera, threads: atra.AlignedTracer(mesh, camera, (4, 1), threads=threads),
    lambda mesh, camera, threads: atra.PixelTracer(mesh, camera, packet_width=1, threads=threads),
    lambda mesh, camera, threads: atra.PixelTracer(mesh, camera, threads=threads),
], ids=["aligned", "single rays", "packets"])  # fmt: skip
def test_it_does_not_matter_which_tracer_finds_the_hits(make):
    scene, atlas = BakeScene(ROOM, sky=render.constant_sky(1.0)), sheet(ROOM, 6)
    direct = np.random.default_rng(1).random((12 * 36, 3))
    usual, other = (carried(scene, atlas, 12, direct, one, size=64, bounces=2) for one in (atra.RasterTracer, make))
    moved = np.abs(usual.hits - other.hits)
    assert moved.sum() <= 1e-4 * usual.hits.sum()  # depths round to the other side of a texel's rim
    same = moved == 0
    assert same.mean() > 0.95
    np.testing.assert_allclose(usual.indirect[same], other.indirect[same], rtol=1e-3, atol=1e-3)
    assert usual.indirect.mean() > 0.1


def test_beyond_the_last_known_hit_nothing_is_seen_and_rays_that_are_cut_are_counted():
    inside, outside = (
        carried(BakeScene(mesh, sky=render.constant_sky(1.0)), sheet(mesh, 6), 8, size=32, layers=1)
        for mesh in (BOX, cube())
    )
    assert inside.rays_cut == inside.rays == outside.rays_cut > 0
    assert inside.hits.max() == 0
    assert outside.hits.sum() == outside.rays  # of fronts; those behind are not among the known
    np.testing.assert_allclose(outside.environment[outside.hits > 0], 1.0, rtol=1e-6)


def test_faces_in_one_place_do_not_hide_each_other():
    twice = joined(quads([floor(0.5)]), quads([floor(0.5)]))
    bundles = carried(BakeScene(twice, sky=render.constant_sky(1.0)), sheet(twice, 6), 16, size=32)
    np.testing.assert_allclose(bundles.environment, 1.0, rtol=1e-6)


def test_backs_take_no_light_and_give_none():
    mesh = joined(quads([floor(1.0)]), quads([floor(1.0, 0.5)]))  # the lower one sees the back of the upper
    bundles = carried(BakeScene(mesh, Surface.plain(mesh, 0.9)), sheet(mesh, 6), 64, 1.0, size=32)
    assert bundles.hits.min() > 0
    assert bundles.indirect.max() == 0.0


def test_what_bundles_cannot_carry_is_refused():
    atlas = sheet(BOX, 4)
    texels, scene = Texels.of(BOX, atlas), BakeScene(BOX)
    direct = np.zeros((len(texels), 3))
    half = Surface.plain(BOX)
    half = Surface(half.albedo, half.emission, np.full(12, 0.5))
    for given, told in (
        ((BakeScene(BOX, half), texels, direct), "some faces let light on"),
        ((BakeScene(cube()), texels, direct), "expected the mesh of the texels"),
        ((scene, texels, direct[:5]), r"direct has shape \(5, 3\)"),
        ((scene, texels, direct * np.nan), "expected finite numbers"),
    ):
        with pytest.raises(InputError, match=told):
            LightBundles(*given)
    for option, value in (("bounces", -1), ("size", 0), ("layers", 5000), ("seed", 0.5)):
        with pytest.raises(InputError, match=f"{option} of bundles is {value!r}"):
            LightBundles(scene, texels, direct, **{option: value})
    bundles = LightBundles(scene, texels, direct, size=8)
    other = cube()
    with atra.RasterTracer(other, bundles.camera, threads=1) as tracer, pytest.raises(InputError, match="tracer is of"):
        bundles.add(tracer)
    with pytest.raises(InputError, match="0 directions"):
        bundles.add(tracer, 0)
