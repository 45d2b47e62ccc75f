"""Light of lightmaps and probes: closed forms, many lights, and what must change no bit."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light as render
from atra.errors import AtraError, ClosedError, InputError
from atra.light import Atlas, Baker, SpotLight
from atra.light.emitters.grid_kernels import LISTED
from tests.baked import baked, cube, painted, sheet, standard_error
from tests.meshes import joined, quads
from tests.shown import floor

PLATE = quads([floor(0.5)])


def test_a_convex_body_in_a_sky_of_one_receives_just_that_and_is_open():
    mesh = cube()
    lightmap = baked(painted(mesh, sky=render.constant_sky(1.0)), sheet(mesh, 6), 8)
    np.testing.assert_allclose(lightmap.environment, 1.0, rtol=1e-5)
    assert lightmap.openness.min() == 1.0
    assert lightmap.indirect.max() == lightmap.direct.max() == 0.0
    assert lightmap.valid.all()


@pytest.mark.parametrize(("albedo", "bounces", "roulette_from"), [(0.5, 4, None), (0.8, 2, None), (0.5, 8, 1)])
def test_a_closed_furnace_has_the_light_of_a_geometric_series(albedo, bounces, roulette_from):
    mesh = cube(inwards=True)
    scene = painted(mesh, albedo, lights=[render.PointLight((0.1, -0.2, 0.15))])
    lightmap = baked(scene, sheet(mesh, 6), 512, bounces=bounces, roulette_from=roulette_from)
    expected = 4 * np.pi / 24 * (1 - albedo ** (bounces + 1)) / (1 - albedo)  # a lamp's light on 24 square units
    error = np.sqrt((standard_error(lightmap) ** 2).sum()) / len(lightmap.samples)
    assert abs(lightmap.luminance.mean() - expected) < 4 * error
    assert error < 0.003 * expected


def corner_factor(a, b):
    """The form factor of a point below the corner of a parallel rectangle a x b, both over the distance."""
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)) / (2 * np.pi)


def test_parallel_unit_plates_have_their_form_factors():
    mesh = joined(PLATE, quads([floor(0.5, 1.0)[::-1]]))
    emission = np.zeros((4, 3))
    emission[2:] = 1.0
    lightmap = baked(painted(mesh, 0.0, emission), sheet(mesh, 8), 2048, bounces=0, open_length=2.0)
    below = lightmap.texels.prim_id < 2
    x, _, z = lightmap.texels.positions[below].T.astype(float)
    steps = (np.arange(8) + 0.5) / 64 - 1 / 16  # within a texel
    x, z = (np.clip(v[:, None, None] + s, -0.5, 0.5) for v, s in ((x, steps[:, None]), (z, steps)))
    expected = sum(corner_factor(0.5 + i * x, 0.5 + k * z) for i in (-1, 1) for k in (-1, 1)).mean(axis=(1, 2))
    interior = np.abs(lightmap.texels.positions[below]).max(axis=1) < 0.49
    got, error = lightmap.direct[below, 0], standard_error(lightmap)[below]
    assert (np.abs(got - expected)[interior] < 5 * error[interior]).all()
    assert got[interior].mean() == pytest.approx(0.19982, rel=0.01)
    assert lightmap.direct[~below].max() == 0.0
    met = 1 - lightmap.openness[below][interior]  # no two points lie farther apart than the square root of 3
    assert (np.abs(met - expected[interior]) < 5 * np.sqrt(expected[interior] / 2048)).all()
    np.testing.assert_allclose(met.mean(), expected[interior].mean(), rtol=0.02)


def test_nothing_leaks_into_a_closed_thin_box_and_its_texels_are_dark():
    mesh = cube(inwards=True)
    flat = atra.Mesh(mesh.vertices * np.float32([1, 0.001, 1]), mesh.faces)
    scene = painted(flat, lights=[render.Sun((0.1, -1, 0.2))], sky=render.constant_sky(1.0))
    lightmap = baked(scene, sheet(flat, 6), 64)
    assert lightmap.combined.max() == 0.0


def test_many_lights_after_a_bounce_are_chosen_without_bias():
    walls = quads([floor(1.0), [(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)]])
    lights = [
        render.PointLight((0.3, 1.0, 0.2), power=2.0),
        render.Sun((0, -1, -1)),
        render.SphereLight((0, 3, 0), 0.5),
    ]
    atlas = sheet(walls, 6)
    together = baked(painted(walls, 0.6, lights=lights), atlas, 512)
    alone = [baked(painted(walls, 0.6, lights=[light]), atlas, 512, seed=k + 1) for k, light in enumerate(lights)]
    error = np.sqrt(sum((standard_error(one) ** 2).sum() for one in (together, *alone))) / len(together.samples)
    difference = (together.luminance - sum(one.luminance for one in alone)).mean()
    assert abs(difference) < 4 * error
    assert together.indirect.mean() > 20 * error


BOX = cube(inwards=True)
LIT = painted(
    BOX, (0.7, 0.5, 0.3), np.repeat([[4.0], [0.0]], [2, 10], axis=0), sky=render.constant_sky(0.5),
    lights=[render.PointLight((0.3, 0.4, 0.1)), render.Sun((0, -1, 0.3))],
)  # fmt: skip


def test_threads_change_no_bit_and_another_seed_changes_all():
    atlas = sheet(BOX, 16)
    usual, other = baked(LIT, atlas, 9), baked(LIT, atlas, 9, threads=2)
    for name in ("direct", "indirect", "environment", "openness", "backs", "variance", "samples"):
        np.testing.assert_array_equal(getattr(usual, name), getattr(other, name))
    assert usual.indirect.max() > 0
    other = baked(LIT, atlas, 9, seed=1)
    assert (usual.indirect != other.indirect).any()


def test_a_stop_between_batches_loses_no_sample_and_doubles_none():
    atlas = sheet(BOX, 20)
    asked = []
    with Baker(LIT, atlas, threads=1) as baker:
        assert not baker.add(16, lambda: asked.append(1) or len(asked) > 5)
        assert set(baker.samples.tolist()) == {0, 16}
        while baker.advance(16):
            pass
        np.testing.assert_array_equal(baker.maps.combined, baked(LIT, atlas, 16).combined)


def test_other_lights_start_anew_and_another_mesh_is_refused():
    atlas = sheet(BOX, 6)
    dark = replace(LIT, lights=[])
    with Baker(LIT, atlas, threads=1) as baker:
        baker.add(4)
        baker.update(dark)
        assert baker.samples.max() == 0
        baker.add(4)
        np.testing.assert_array_equal(baker.maps.combined, baked(dark, atlas, 4).combined)
        fewer = atra.Mesh(BOX.vertices, BOX.faces[:-1])
        with pytest.raises(InputError, match="expected other vertices of the same faces"):
            baker.update(painted(fewer))
    with pytest.raises(ClosedError, match="closed"):
        baker.add(1)


def test_what_no_light_could_be_is_refused_with_its_value():
    for option, value in (
        ("bounces", -1), ("roulette_from", -1), ("open_length", 0.0), ("lights", "uniform"), ("seed", -1),
    ):  # fmt: skip
        with pytest.raises(InputError, match=f"{option} is {value!r}"):
            Baker(LIT, sheet(BOX, 6), **{option: value})
    with pytest.raises(InputError, match=r"scene is Mesh.*expected a Scene; of a mesh, Scene.plain\(mesh\)"):
        Baker(PLATE)
    bright = render.PanoramaSky(np.full((2, 4, 3), 1e38, np.float32), power=1e12)
    with pytest.raises(AtraError, match=r"texel \(\d+, \d+\) is not finite at sample"):
        baked(painted(PLATE, sky=bright), sheet(PLATE, 4), 1)
    with pytest.raises(InputError, match="samples is 0"):
        baked(LIT, sheet(BOX, 6), 0)
    with Baker(LIT, sheet(BOX, 6)) as baker, pytest.raises(InputError, match="target is 0"):
        baker.advance(0)
    with pytest.raises(InputError, match="the atlas has 2 triangles"):
        baked(LIT, Atlas.of_uv(np.zeros((2, 3, 2)), 8, 8), 1)


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


def test_samples_of_a_texel_are_spread_evenly_so_that_maps_lie_nearer_to_each_other_than_random_samples_would():
    scene = painted(OPEN, lights=[render.Sun((0.3, -1, 0.2), 20.0)], sky=render.GradientSky())
    one, other = (baked(scene, sheet(OPEN, 8), 64, seed=seed) for seed in (1, 2))
    for name in ("environment", "direct", "indirect"):
        apart = one.light(name).mean(axis=1) - other.light(name).mean(axis=1)
        assert np.abs(apart.mean()) < 4 * apart.std() / np.sqrt(len(apart)), name
    random = np.sqrt((standard_error(one) ** 2 + standard_error(other) ** 2).mean())
    assert 0.0 < np.sqrt(((one.luminance - other.luminance) ** 2).mean()) < 0.8 * random


@pytest.mark.parametrize("shines", [False, True], ids=["lamps", "lamps, a panel and a sky"])
def test_a_grid_of_lamps_has_the_mean_of_a_choice_by_power_and_less_noise(shines):
    sky = np.full((8, 16, 3), 0.02, np.float32)
    sky[1, 5] = 5.0
    panel = quads([floor(0.4, 1.9)[::-1]])
    mesh = joined(OPEN, panel)
    emission = np.repeat([0.0, 0.2 * shines], [4, 2])[:, None]
    scene = painted(mesh, 0.7, emission, lights=many(100), sky=render.PanoramaSky(sky, float(shines)))
    assert len(scene.lights) > LISTED
    aimed, grid = (baked(scene, sheet(mesh, 8), 256, lights=how, seed=k) for k, how in enumerate(("aimed", "grid")))
    for name in ("indirect", "direct", "environment"):
        difference = (grid.light(name) - aimed.light(name)).mean()
        error = np.hypot(mean_and_error(aimed)[1], mean_and_error(grid)[1])
        assert abs(difference) < 4 * error, name
    assert grid.direct.mean() > 20 * mean_and_error(grid)[1]
    assert grid.variance.mean() < 0.8 * aimed.variance.mean()


def probes(scene, points, samples=1024, **options):
    with Baker(scene, sheet(scene.mesh, 4), **{"threads": 1} | options) as baker:
        return baker.probes(points, samples)


FAR = atra.Mesh(cube().vertices + np.float32([1e4, 0, 0]), cube().faces)


def test_a_probe_in_a_sky_of_one_has_just_that_mean():
    made = probes(painted(FAR, 0.0, sky=render.constant_sky(1.0)), np.zeros((2, 3)), 128)
    np.testing.assert_allclose(made.environment[:, 0], 2 * np.sqrt(np.pi), rtol=1e-6)
    assert np.abs(made.combined[:, 1:]).max() < 0.2
    assert made.direct.max() == made.backs.max() == 0.0


def test_a_probe_has_the_harmonics_of_suns_points_and_the_sky():
    sun = render.Sun((1.0, -2.0, 0.5), 0.0, (1.0, 0.5, 0.25), 3.0)
    y = np.array((-1.0, 2.0, -0.5)) / np.sqrt(5.25)
    made = probes(painted(FAR, lights=[sun]), [(0, 0, 0)], 1)
    assert made.direct[0, 0] == pytest.approx(3 * np.pi * np.array(sun.colour) / np.sqrt(4 * np.pi), rel=1e-5)
    linear = np.sqrt(3 / (4 * np.pi)) * y[[1, 2, 0]]
    np.testing.assert_allclose(made.direct[0, 1:4, 0], 3 * np.pi * linear, rtol=1e-5)
    assert made.direct[0, 6, 1] == pytest.approx(
        1.5 * np.pi * np.sqrt(5 / (16 * np.pi)) * (3 * y[2] ** 2 - 1), rel=1e-4
    )
    point = probes(painted(FAR, lights=[render.PointLight((0, 2, 0))]), [(0, 0, 0), (0, 1, 0)], 1)
    np.testing.assert_allclose(point.direct[:, 0, 0], np.pi / np.array([4, 1]) / np.sqrt(4 * np.pi), rtol=1e-4)
    np.testing.assert_allclose(point.direct[1, :, 0], 4 * point.direct[0, :, 0], rtol=1e-4, atol=1e-6)
    height = np.cos((np.arange(64) + 0.5) * np.pi / 64)
    rising = render.PanoramaSky(np.broadcast_to((1.0 + 0.8 * height)[:, None, None], (64, 8, 3)))
    found = probes(painted(FAR, sky=rising), np.zeros((4, 3)), 2048).environment[..., 0].mean(axis=0)
    expected = np.array([4 * np.pi / np.sqrt(4 * np.pi), 0.8 * np.sqrt(3 / (4 * np.pi)) * 4 * np.pi / 3])
    np.testing.assert_allclose(found[:2], expected, rtol=0.03)


def test_a_probe_lights_a_surface_as_the_harmonics_of_a_cosine_do():
    directions = np.random.default_rng(1).normal(size=(2, 40, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    for to_sun, normal in directions.swapaxes(0, 1)[:4]:
        made = probes(painted(FAR, lights=[render.Sun((-to_sun).tolist(), 0.0, power=2.0)]), np.zeros((1, 3)), 1)
        cosine = to_sun @ normal
        expected = 2.0 * (1.0 + 2.0 * cosine + 1.25 * (3.0 * cosine**2 - 1.0) / 2.0) / 4.0
        np.testing.assert_allclose(made.light(normal), [[expected] * 3], rtol=1e-4, atol=1e-5)


def test_a_probe_in_a_furnace_has_the_light_of_a_geometric_series_and_sees_a_lamp_by_its_solid_angle():
    scene = painted(BOX, 0.9, lights=[render.PointLight((0.1, -0.2, 0.15))])
    made = probes(scene, np.random.default_rng(1).uniform(-0.9, 0.9, (16, 3)), 512, bounces=100, roulette_from=None)
    # Light after many bounces is as bright everywhere: nine times the lamp's, spread over the walls.
    light = (made.indirect[:, 0] * np.sqrt(4 * np.pi) / (4 * np.pi)).mean()
    assert light == pytest.approx(9 * 4 * np.pi / 24, rel=0.03)
    lamp = quads([floor(1.0, 1.0)[::-1]])  # a side of a cube around the probe
    mesh = joined(lamp, FAR)
    seen = probes(painted(mesh, 0.0, np.repeat([[1.0], [0.0]], [2, 12], axis=0)), np.zeros((4, 3)), 4096)
    sixth = 4 * np.pi / 6
    assert seen.direct[:, 0, 0].mean() * np.sqrt(4 * np.pi) == pytest.approx(sixth, rel=0.01)
    inside = probes(painted(cube()), np.zeros((1, 3)), 64)
    assert inside.backs.tolist() == [1.0]


def test_probes_are_the_same_to_the_bit_however_rays_are_grouped_and_leave_the_map_alone(tmp_path):
    points = np.random.default_rng(1).uniform(-0.9, 0.9, (40, 3))
    usual = probes(LIT, points, 100)
    np.testing.assert_array_equal(usual.combined, probes(LIT, points, 100, threads=2).combined)
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
    scene = painted(FAR, lights=[render.PointLight((0, 0, 1e-14), power=1e12)])
    with pytest.raises(AtraError, match=r"probe 1 at \[0\.0, 0\.0, 0\.0\] is not finite"):
        probes(scene, [(5, 5, 5), (0, 0, 0)], 1)
