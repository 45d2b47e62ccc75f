"""Many lights and light probes: what their means are, and what must change no bit."""

import numpy as np
import pytest

import atra
from atra import light as render
from atra.errors import AtraError, InputError
from atra.light import Baker, SpotLight, Texels
from atra.light.emitters.grid_kernels import LISTED
from tests.baked import baked, cube, painted, sheet, standard_error
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


def test_samples_of_a_texel_are_spread_evenly_so_that_maps_lie_nearer_to_each_other_than_random_samples_would():
    scene = painted(OPEN, lights=[render.Sun((0.3, -1, 0.2), 20.0)], sky=render.GradientSky())
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
    rows, columns = 16, 32
    height = np.cos((np.arange(rows) + 0.5) * np.pi / rows)
    texels = np.broadcast_to((1.0 + 0.8 * height)[:, None, None], (rows, columns, 3))
    texels = np.where(np.indices((rows, columns))[1][..., None] == 3, 20 * texels, texels)
    bands = -np.diff(np.cos(np.linspace(0, np.pi, rows + 1))) * 2 * np.pi / columns
    expected = (texels[..., 0] * bands[:, None]).sum() / np.sqrt(4 * np.pi)
    edges = np.cos(np.linspace(0, np.pi, rows + 1))
    upward = (texels[..., 0].sum(axis=1) * (edges[:-1] ** 2 - edges[1:] ** 2) / 2 * 2 * np.pi / columns).sum()
    scene = painted(FAR, sky=render.PanoramaSky(texels))
    found = probes(scene, np.zeros((4, 3)), 2048).environment[..., 0].mean(axis=0)
    assert found[0] == pytest.approx(expected, rel=0.03)
    assert found[1] == pytest.approx(np.sqrt(3 / (4 * np.pi)) * upward, rel=0.06)


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
