"""Many lights, adaptive sampling and light probes: what their means are, and what must change no bit."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light as render
from atra.errors import AtraError, InputError
from atra.light import Baker, BakeScene, SpotLight, Surface, Texels
from atra.light.lightmaps.batches import new_batch
from atra.light.lightmaps.gather.choice_kernels import cell_of, chosen, odds_of
from atra.light.lightmaps.gather.grid import LISTED, light_grid
from atra.light.lightmaps.gather.lights import light_rows
from atra.light.lightmaps.gather.lights_kernels import aim, aim_at_sun
from atra.light.lightmaps.gather.tables import tables_of
from atra.light.lightmaps.gather.tables_kernels import CARRIED, DIRECTION, LENGTH, NORMAL, WEIGHT
from tests.baked import baked, cube, sheet, standard_error
from tests.light.lightmaps.test_light import BOX, LIT
from tests.meshes import joined, quads
from tests.shown import floor

ATLAS = sheet(BOX, 6)
OPEN = quads([floor(2.0), [(-2, 0, -2), (2, 0, -2), (2, 2, -2), (-2, 2, -2)]])


def many(count):
    """Points and spots near a floor and a wall, most of them weak where another is near."""
    places = np.random.default_rng(3).uniform((-2, 0.05, -1.9), (2, 1.5, 2), (count, 3)).tolist()
    return [
        SpotLight(place, (0, -1, -0.5), power=0.01) if k % 3 == 0 else render.PointLight(place, power=0.01)
        for k, place in enumerate(places)
    ]


def mean_and_error(lightmap):
    return lightmap.luminance.mean(), np.sqrt((standard_error(lightmap) ** 2).sum()) / len(lightmap.samples)


@pytest.mark.parametrize("vertex", [0, 2])
def test_rays_to_a_sun_are_the_same_from_vectors_of_paths_as_one_by_one(vertex):
    """Backs, idle lanes and paths in the open among them."""
    rays = 1003
    suns = [render.Sun((1, -2, 0.5), angle, (3.0, 2.0, 1.0)) for angle in (0.0, 8.0)]
    scene = BakeScene(BOX, lights=suns)
    with Baker(scene, ATLAS) as baker:
        tables = tables_of(scene, baker.texels, baker.options)
    found = []
    for which, aim_all in ((1, aim), (1, aim_at_sun), (0, aim)):
        batch, random = new_batch(rays), np.random.default_rng(5)
        normals = random.normal(size=(3, rays))
        batch.floats[NORMAL : NORMAL + 3, :rays] = normals / np.linalg.norm(normals, axis=0)
        batch.floats[NORMAL : NORMAL + 3, 500:520] = 0.0
        batch.floats[WEIGHT : WEIGHT + 3, :rays] = random.random((3, rays))
        batch.sequence[:], batch.alive[:] = np.arange(rays), random.random(rays) < 0.7
        light = tables if aim_all is aim else tuple(tables.lights[which])
        aim_all(batch, rays, light, which, vertex)
        lit = batch.floats[LENGTH, :rays] > 0.0
        found.append(
            (lit, batch.floats[DIRECTION : DIRECTION + 3, :rays][:, lit], batch.floats[CARRIED:, :rays][:, lit])
        )
    assert 0.2 < found[0][0].mean() < 0.5
    for one_by_one, by_vectors in zip(found[0], found[1], strict=True):
        np.testing.assert_array_equal(by_vectors, one_by_one)
    assert not np.array_equal(found[2][1], found[0][1])


def test_samples_of_a_texel_are_spread_evenly_so_that_maps_lie_nearer_to_each_other_than_random_samples_would():
    scene = BakeScene(OPEN, Surface.plain(OPEN, 0.7), [render.Sun((0.3, -1, 0.2), 20.0)], render.GradientSky())
    one, other = (baked(scene, sheet(OPEN, 8), 64, seed=seed) for seed in (1, 2))
    for name in ("environment", "direct", "indirect"):
        apart = one.light(name).mean(axis=1) - other.light(name).mean(axis=1)
        assert np.abs(apart.mean()) < 4 * apart.std() / np.sqrt(len(apart)), name
    random = np.sqrt((standard_error(one) ** 2 + standard_error(other) ** 2).mean())
    assert 0.0 < np.sqrt(((one.luminance - other.luminance) ** 2).mean()) < 0.8 * random


def test_texels_side_by_side_in_a_batch_lie_near_each_other_in_space():
    texels = Texels.of(BOX, sheet(BOX, 16))
    order = texels.along_curve
    assert sorted(order.tolist()) == list(range(len(texels)))
    random = np.random.default_rng(1).permutation(len(texels))
    steps = [np.linalg.norm(np.diff(texels.positions[one], axis=0), axis=1).mean() for one in (order, random)]
    assert steps[0] < 0.2 * steps[1]


def test_a_grid_of_lights_has_the_mean_of_a_uniform_choice_and_less_noise():
    sky = np.full((8, 16, 3), 0.02, np.float32)
    sky[1, 5] = 5.0
    emission = np.repeat([(0.0, 0.0, 0.0), (0.2, 0.1, 0.1)], 2, axis=0)
    scene = BakeScene(OPEN, Surface.plain(OPEN, 0.7, emission), many(100), render.PanoramaSky(sky))
    assert len(scene.lights) + 2 > LISTED
    atlas = sheet(OPEN, 8)
    lamp = replace(scene, lights=many(6), surface=Surface.plain(OPEN, 0.7, 100 * emission))
    bright = replace(lamp, surface=Surface.plain(OPEN, 0.7), sky=render.PanoramaSky(sky, power=50.0))
    for one in (scene, lamp, bright):
        uniform, grid = (baked(one, atlas, 192, lights=lights, seed=k) for k, lights in enumerate(("uniform", "grid")))
        for name in ("indirect", "direct", "environment"):
            difference = (grid.light(name) - uniform.light(name)).mean()
            error = np.hypot(mean_and_error(uniform)[1], mean_and_error(grid)[1])
            assert abs(difference) < 4 * error, name
        assert grid.indirect.mean() > 20 * mean_and_error(grid)[1]
        assert grid.variance.mean() < uniform.variance.mean()
    other = baked(scene, atlas, 3, lights="grid", batch_rays=1 << 9, expansion=2, compaction="none", threads=2)
    np.testing.assert_array_equal(baked(scene, atlas, 3, lights="grid").combined, other.combined)


def test_the_odds_of_every_cell_add_up_to_one_and_follow_what_is_near():
    lights = many(200)
    bounds = np.array([(-2, 0, -2), (2, 2, 2)], float)
    made = light_grid(light_rows(tuple(lights), []), bounds)
    assert made.listed.shape == (32 * 16 * 32, LISTED)
    np.testing.assert_allclose(made.of_all + made.odds.sum(axis=1), 1.0, atol=1e-5)
    assert made.of_all.min() >= 0.1 - 1e-6
    for light in (1, 2, 4):  # points
        place = ((np.array(lights[light].position) - bounds[0]) / np.diff(bounds, axis=0)[0] * (32, 16, 32)).astype(int)
        cell = (place[0] * 16 + place[1]) * 32 + place[2]
        assert light in made.listed[cell, :3]
    above = light_grid(light_rows((SpotLight((0, 1, 0), (0, 1, 0)), render.PointLight((0, 1, 0))), []), bounds)
    below = np.indices((32, 16, 32)).reshape(3, -1)[1] < 4
    assert (above.odds[below][above.listed[below] == 0] == 0).all()  # behind a spot
    flat = light_grid(light_rows((render.Sun((0, -1, 0)),), []), np.array([(0, 0, 0), (4, 0, 2)], float))
    assert flat.listed.shape == (32 * 1 * 16, 1)


def test_lights_are_chosen_as_often_as_their_odds_say():
    scene = BakeScene(OPEN, lights=many(100))
    with Baker(scene, sheet(OPEN, 4), threads=1, lights="grid") as baker:
        tables = tables_of(scene, baker.texels, baker.options)
    cell = cell_of(tables, (np.float32(0.5), np.float32(0.1), np.float32(-0.3)))
    found = [chosen(tables, cell, np.float32((k + 0.5) / 4000)) for k in range(4000)]
    count, odds = np.zeros(100), np.array([odds_of(tables, cell, light) for light in range(100)])
    for light, told in found:
        count[light] += 1
        assert told == odds[light]
    np.testing.assert_allclose(count / 4000, odds, atol=6e-4)
    assert odds.sum() == pytest.approx(1, abs=1e-5)
    assert (odds > 0).all()
    assert odds.max() > 0.05


def until(scene, target, **options):
    with Baker(scene, sheet(BOX, 4), **{"threads": 1, "adaptive": True} | options) as baker:
        if options.get("compaction") == "none":
            baker.look(atra.Camera((0, 0, 0), (1, 0.2, 0.1), width=32, height=32))
        while baker.advance(target):
            pass
        return baker.maps


def test_what_is_done_of_an_adaptive_bake_is_all_of_it_in_the_end():
    dark = BakeScene(BOX, Surface.plain(BOX, 0.02), [render.PointLight((0.1, 0.2, 0.3))])
    done = []
    with Baker(dark, sheet(BOX, 4), threads=1, adaptive=True) as baker:
        assert baker.share_done(1024) == 0.0
        while baker.advance(1024):
            done.append(baker.share_done(1024))
        assert baker.samples.mean() < 1024
    assert done == sorted(done)
    assert done[0] == pytest.approx(16 / 1024)
    assert done[-1] == 1.0


def test_adaptive_sampling_stops_where_one_percent_is_reached_however_samples_are_grouped():
    scene = replace(LIT, surface=Surface.plain(BOX, (0.3, 0.1, 0.1)), lights=[render.PointLight((0.1, 0.2, 0.3))])
    lightmap = until(scene, 4096)
    samples = np.unique(lightmap.samples)
    assert set(samples) <= {64 << k for k in range(7)}
    assert len(samples) > 2
    stopped = lightmap.samples < 4096
    assert 0.05 < stopped.mean() < 1.0
    assert (2.58 * standard_error(lightmap) <= 0.01 * lightmap.luminance)[stopped].all()
    for options in ({"expansion": 5, "batch_rays": 1 << 9}, {"compaction": "none", "threads": 2}):
        other = until(scene, 4096, **options)
        np.testing.assert_array_equal(lightmap.samples, other.samples)
        np.testing.assert_array_equal(lightmap.combined, other.combined)
    whole = baked(scene, sheet(BOX, 4), 4096, seed=1)
    assert abs(lightmap.luminance.mean() / whole.luminance.mean() - 1) < 0.005
    dark = until(replace(scene, lights=[], sky=render.constant_sky(0.0)), 128)
    assert (dark.samples == 128).all()  # what found no light is not known to be dark
    with pytest.raises(InputError, match="adaptive is 1, expected True or False"):
        until(scene, 64, adaptive=1)
    with pytest.raises(InputError, match="lights is 'near'"):
        until(scene, 64, lights="near")


def probes(scene, points, samples=1024, **options):
    with Baker(scene, sheet(scene.mesh, 4), **{"threads": 1} | options) as baker:
        return baker.probes(points, samples)


FAR = atra.Mesh(cube().vertices + np.float32([1e4, 0, 0]), cube().faces)


def test_a_probe_in_a_sky_of_one_has_just_that_mean():
    made = probes(BakeScene(FAR, Surface.plain(FAR, 0.0), sky=render.constant_sky(1.0)), np.zeros((2, 3)), 100)
    np.testing.assert_allclose(made.environment[:, 0], 2 * np.sqrt(np.pi), rtol=1e-6)
    assert np.abs(made.combined[:, 1:]).max() < 0.1
    assert made.direct.max() == made.backs.max() == 0.0


def test_a_probe_has_the_harmonics_of_suns_points_and_the_sky():
    sun = render.Sun((1.0, -2.0, 0.5), 0.0, (1.0, 0.5, 0.25), 3.0)
    y = np.array((-1.0, 2.0, -0.5)) / np.sqrt(5.25)
    made = probes(BakeScene(FAR, lights=[sun]), [(0, 0, 0)], 1)
    assert made.direct[0, 0] == pytest.approx(3 * np.pi * np.array(sun.colour) / np.sqrt(4 * np.pi), rel=1e-5)
    linear = np.sqrt(3 / (4 * np.pi)) * y[[1, 2, 0]]
    np.testing.assert_allclose(made.direct[0, 1:4, 0], 3 * np.pi * linear, rtol=1e-5)
    assert made.direct[0, 6, 1] == pytest.approx(
        1.5 * np.pi * np.sqrt(5 / (16 * np.pi)) * (3 * y[2] ** 2 - 1), rel=1e-4
    )
    point = probes(BakeScene(FAR, lights=[render.PointLight((0, 2, 0))]), [(0, 0, 0), (0, 1, 0)], 1)
    np.testing.assert_allclose(point.direct[1, :, 0], 4 * point.direct[0, :, 0], rtol=1e-4, atol=1e-6)
    rows, columns = 16, 32
    height = np.cos((np.arange(rows) + 0.5) * np.pi / rows)
    texels = np.broadcast_to((1.0 + 0.8 * height)[:, None, None], (rows, columns, 3))
    texels = np.where(np.indices((rows, columns))[1][..., None] == 3, 20 * texels, texels)
    bands = -np.diff(np.cos(np.linspace(0, np.pi, rows + 1))) * 2 * np.pi / columns
    expected = (texels[..., 0] * bands[:, None]).sum() / np.sqrt(4 * np.pi)
    edges = np.cos(np.linspace(0, np.pi, rows + 1))
    upward = (texels[..., 0].sum(axis=1) * (edges[:-1] ** 2 - edges[1:] ** 2) / 2 * 2 * np.pi / columns).sum()
    for environment in ("mis", "light", "bsdf"):
        scene = BakeScene(FAR, sky=render.PanoramaSky(texels))
        found = probes(scene, np.zeros((4, 3)), 2048, environment=environment).environment[..., 0].mean(axis=0)
        assert found[0] == pytest.approx(expected, rel=0.03), environment
        assert found[1] == pytest.approx(np.sqrt(3 / (4 * np.pi)) * upward, rel=0.06), environment


def test_a_probe_lights_a_surface_as_the_harmonics_of_a_cosine_do():
    directions = np.random.default_rng(1).normal(size=(2, 40, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    for to_sun, normal in directions.swapaxes(0, 1)[:4]:
        made = probes(BakeScene(FAR, lights=[render.Sun((-to_sun).tolist(), 0.0, power=2.0)]), np.zeros((1, 3)), 1)
        cosine = to_sun @ normal
        expected = 2.0 * (1.0 + 2.0 * cosine + 1.25 * (3.0 * cosine**2 - 1.0) / 2.0) / 4.0
        np.testing.assert_allclose(made.light(normal), [[expected] * 3], rtol=1e-4, atol=1e-5)


def test_a_probe_in_a_furnace_has_the_light_of_a_geometric_series_and_sees_a_lamp_by_its_solid_angle():
    scene = BakeScene(BOX, Surface.plain(BOX, 0.5, 1.0))
    made = probes(scene, np.random.default_rng(1).uniform(-0.9, 0.9, (16, 3)), 512, bounces=4, roulette_from=None)
    light = made.light([(0, 1, 0)]).mean()
    assert light == pytest.approx((1 - 0.5**5) / 0.5, rel=0.02)
    lamp = quads([floor(1.0, 1.0)[::-1]])  # a side of a cube around the probe
    mesh = joined(lamp, FAR)
    surface = Surface.plain(mesh, 0.0, np.repeat([[1.0], [0.0]], [2, 12], axis=0))
    seen = probes(BakeScene(mesh, surface), np.zeros((4, 3)), 4096)
    sixth = 4 * np.pi / 6
    assert seen.direct[:, 0, 0].mean() * np.sqrt(4 * np.pi) == pytest.approx(sixth, rel=0.01)
    inside = probes(BakeScene(cube()), np.zeros((1, 3)), 64)
    assert inside.backs.tolist() == [1.0]


def test_probes_are_the_same_to_the_bit_however_rays_are_grouped_and_leave_the_map_alone(tmp_path):
    points = np.random.default_rng(1).uniform(-0.9, 0.9, (40, 3))
    usual = probes(LIT, points, 100)
    for options in ({"batch_rays": 1 << 8}, {"threads": 2, "compaction": "texels"}, {"compaction": "none"}):
        np.testing.assert_array_equal(usual.combined, probes(LIT, points, 100, **options).combined)
    with Baker(LIT, ATLAS, threads=1) as baker:
        baker.add(3)
        np.testing.assert_array_equal(usual.direct, baker.probes(points, 100).direct)
        baker.add(6)
        np.testing.assert_array_equal(baker.maps.combined, baked(LIT, ATLAS, 9).combined)
        for points, told in (
            (np.zeros(3), r"shape \(3,\), expected \(N, 3\)"), (np.zeros((0, 3)), "shape"),
            ([(0, 0, 0), (0, np.nan, 0)], r"probe 1 is \[0.0, nan, 0.0\]"), ("here", "cannot be read"),
        ):  # fmt: skip
            with pytest.raises(InputError, match=told):
                baker.probes(points)
    with np.load(usual.save(tmp_path / "probes.npz")) as kept:
        np.testing.assert_array_equal(kept["indirect"], usual.indirect)
        assert kept["points"].shape == (40, 3)
        assert kept["samples"] == 100
    with pytest.raises(InputError, match=r"ends in \.npz"):
        usual.save(tmp_path / "probes.txt")


def test_light_beyond_all_numbers_is_reported_with_its_probe():
    scene = BakeScene(FAR, lights=[render.PointLight((0, 0, 1e-14), power=1e12)])
    with pytest.raises(AtraError, match=r"probe 1 at \[0\.0, 0\.0, 0\.0\] is not finite"):
        probes(scene, [(5, 5, 5), (0, 0, 0)], 1)
