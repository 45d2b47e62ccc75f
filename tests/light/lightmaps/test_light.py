"""Light of lightmaps against closed forms: furnace, form factors, lights, the sky, and what must change no bit."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light as render
from atra.errors import AtraError, ClosedError, InputError
from atra.light import Atlas, Baker, SpotLight
from experiments.light.wave_baker import WaveBaker
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


def test_a_sky_that_grows_brighter_upwards_gives_what_its_mean_by_the_cosine_says():
    sky = render.GradientSky((0.2, 0.4, 1.0), (1.0, 0.5, 0.0), 2.0)
    lightmap = baked(painted(PLATE, 0.0, sky=sky), sheet(PLATE, 6), 2048)
    below, above = np.array(sky.below), np.array(sky.above)
    expected = 2.0 * (below + (above - below) * 5 / 6)  # the mean height by the cosine is 2/3
    np.testing.assert_allclose(lightmap.environment.mean(axis=0), expected, rtol=0.002)


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
    """Of a point below the corner of a parallel rectangle a x b, both over the distance."""
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


def test_suns_points_and_spots_give_what_their_laws_say():
    atlas = sheet(PLATE, 8)
    sun = render.Sun((1.0, -2.0, 0.5), 0.0, (1.0, 0.5, 0.25), 3.0)
    lightmap = baked(painted(PLATE, 0.0, lights=[sun]), atlas, 2)
    expected = 3.0 * np.array(sun.colour) * 2.0 / np.sqrt(5.25)
    np.testing.assert_allclose(lightmap.direct, np.broadcast_to(expected, lightmap.direct.shape), rtol=1e-5)
    point = render.PointLight((0.2, 0.7, -0.1), power=5.0)
    spot = SpotLight(point.position, (0, -1, 0), 20.0, 30.0, power=5.0)
    of_point, of_spot = (baked(painted(PLATE, 0.0, lights=[light]), atlas, 1024) for light in (point, spot))
    way = np.array(point.position) - of_point.texels.positions
    expected = 5.0 * way[:, 1] / np.linalg.norm(way, axis=1) ** 3
    np.testing.assert_allclose(of_point.direct[:, 0], expected, rtol=0.03)
    angle = np.degrees(np.arctan2(np.hypot(way[:, 0], way[:, 2]), way[:, 1]))
    assert (of_spot.direct[angle > 36, 0] == 0).all()
    np.testing.assert_allclose(of_spot.direct[angle < 14], of_point.direct[angle < 14], rtol=1e-5)


def test_nothing_leaks_into_a_closed_thin_box_and_its_texels_are_dark():
    mesh = cube(inwards=True)
    flat = atra.Mesh(mesh.vertices * np.float32([1, 0.001, 1]), mesh.faces)
    scene = painted(flat, lights=[render.Sun((0.1, -1, 0.2))], sky=render.constant_sky(1.0))
    lightmap = baked(scene, sheet(flat, 6), 64)
    assert lightmap.combined.max() == 0.0


def test_light_of_a_small_sun_in_the_sky_is_the_same_on_average_whatever_ends_paths_and_finds_the_sky():
    texels = np.full((8, 16, 3), 0.02, np.float32)
    texels[2, 3] = 40.0  # a small sun
    walls = quads([floor(1.0), [(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)]])
    scene = painted(walls, 0.6, sky=render.PanoramaSky(texels))
    atlas = sheet(walls, 6)
    found = {}
    for name, options in (("mis", {}), ("bsdf", {"environment": "bsdf"}), ("no roulette", {"roulette_from": None})):
        with WaveBaker(scene, atlas, threads=1, seed=len(found), **options) as baker:
            baker.add(768)
            lightmap = baker.maps
        error = np.sqrt((standard_error(lightmap) ** 2).sum()) / len(lightmap.samples)
        found[name] = lightmap.luminance.mean(), error
    mean, error = found.pop("mis")
    for name, (other, other_error) in found.items():
        assert abs(other - mean) < 4 * np.hypot(error, other_error), name
    assert error < 0.2 * found["bsdf"][1]  # aiming pays


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


def panes(*tints):
    """A floor beneath sheets of clear glass of these colours, one above the other, far wider than it."""
    mesh = joined(PLATE, *(quads([floor(500.0, 0.5 + 0.2 * k)]) for k in range(len(tints))))
    glass = [render.MetallicRoughness(tint, roughness=0.0, transmission=1.0) for tint in tints]
    uv = np.full((mesh.triangle_count, 3, 2), np.nan)
    uv[:2] = sheet(PLATE, 6).uv
    atlas = Atlas(uv, np.where(np.arange(len(uv)) < 2, 0, -1), 10, 10)
    numbers = np.arange(mesh.triangle_count) // 2
    return render.Scene(mesh, [render.Lambertian(0.0), *glass], numbers, sky=render.constant_sky(0.0)), atlas


def test_the_sun_passes_panes_by_the_product_of_their_tints_in_any_order():
    tints = np.array([(1.0, 0.5, 0.25), (0.8, 0.9, 0.1), (0.5, 1.0, 1.0)])
    expected = 0.96**3 * np.prod(tints, axis=0)
    for order in ([0, 1, 2], [2, 0, 1]):
        scene, atlas = panes(*tints[order].tolist())
        lightmap = baked(replace(scene, lights=[render.Sun((0, -1, 0), 0.0)]), atlas, 8, bounces=0)
        np.testing.assert_allclose(lightmap.direct, np.broadcast_to(expected, lightmap.direct.shape), rtol=1e-4)


def test_a_scene_of_opaque_faces_is_the_same_to_the_bit_beside_a_pane_that_is_far_away():
    far = atra.Mesh(PLATE.vertices + np.float32([0, 0, 300]), PLATE.faces)
    mesh = joined(BOX, far)
    uv = np.concatenate([sheet(BOX, 6).uv, np.full((2, 3, 2), np.nan)])
    atlas = Atlas(uv, np.where(np.isnan(uv[:, 0, 0]), -1, 0), *[sheet(BOX, 6).width] * 2)
    numbers = np.append(LIT.face_materials, [2, 2])
    pane = render.MetallicRoughness((0.5, 0.5, 0.5), 0.5, "blend")
    scenes = [
        replace(LIT, mesh=mesh, materials=[*LIT.materials, last], face_materials=numbers)
        for last in (render.Lambertian(0.5), pane)
    ]
    plain, through = (baked(scene, atlas, 8) for scene in scenes)
    np.testing.assert_array_equal(plain.combined, through.combined)
    assert plain.indirect.mean() > 0


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


def test_seen_texels_come_first_and_the_order_changes_no_bit():
    atlas = sheet(BOX, 6)
    with Baker(LIT, atlas, threads=1) as baker:
        baker.look(atra.Camera((0, 0, 0), (1, 0.2, 0.1), width=32, height=32))
        assert 0.05 < baker.visible.mean() < 0.9
        assert baker.advance(16)
        assert (baker.samples == np.where(baker.visible, 16, 0)).all()
        while baker.advance(16):
            pass
        assert (baker.samples == 16).all()
        first = baker.maps.combined
    np.testing.assert_array_equal(first, baked(LIT, atlas, 16).combined)


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
    with pytest.raises(InputError, match="outer_degrees of SpotLight is 100"):
        SpotLight((0, 1, 0), (0, -1, 0), outer_degrees=100)
    bright = render.PanoramaSky(np.full((2, 4, 3), 1e38, np.float32), power=1e12)
    with pytest.raises(AtraError, match=r"texel \(\d+, \d+\) is not finite at sample"):
        baked(painted(PLATE, sky=bright), sheet(PLATE, 4), 1)
    with pytest.raises(InputError, match="samples is 0"):
        baked(LIT, sheet(BOX, 6), 0)
    with pytest.raises(InputError, match="the atlas has 2 triangles"):
        baked(LIT, Atlas.of_uv(np.zeros((2, 3, 2)), 8, 8), 1)
