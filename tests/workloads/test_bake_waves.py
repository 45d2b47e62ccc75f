"""Bakes beside others: the wing's baker in waves, and Mitsuba 3's paths from the same points."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from atra import light
from atra.errors import InputError
from atra.light import Baker
from atra.light.lightmaps.paths import Paths
from experiments.light.bake import BAKE
from experiments.light.bake.measure import bake_scene
from experiments.light.bake.mitsuba import MitsubaPaths, with_plain_light
from experiments.light.mitsuba_light import load_mitsuba, suns_of
from experiments.light.wave_baker import WaveBaker
from experiments.light.waves_kernels import DIRECTION, NEAR, ORIGIN, generate, new_wave, scatter, trace
from experiments.workloads.rounds import load_mesh
from scenes.lit.lighting import lit
from tests.baked import cube, painted, sheet, shining_room, standard_error
from tests.light.lightmaps.test_light import BOX, LIT
from tests.meshes import joined, quads
from tests.points import planned
from tests.shown import floor
from tests.workloads.test_bake_points import measured, xatlas

RAYS = 10_000


def nearest(mesh, origins, ways):
    """(R, F) float64: how far each ray meets each triangle, inf where it does not. By Cramer's rule."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    found = np.full((len(origins), len(a)), np.inf)
    for face in range(len(a)):
        u, v = b[face] - a[face], c[face] - a[face]
        across = np.cross(ways, v)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1.0 / (across @ u)
            off = origins - a[face]
            x, other = (across * off).sum(axis=1) * scale, np.cross(off, u)
            y, t = (other * ways).sum(axis=1) * scale, other @ v * scale
        inside = (x >= 0) & (y >= 0) & (x + y <= 1) & (t > 0)
        found[inside, face] = t[inside]
    return found


ROOM = joined(cube(inwards=True), cube(0.3))
GLASS = light.MetallicRoughness((0.9, 0.6, 0.3), roughness=0.0, transmission=1.0)
MASK = light.MetallicRoughness((0.9, 0.6, 0.3), opacity=0.5, alpha="blend")
MIXED = light.Scene(
    ROOM, [light.Lambertian(0.6), GLASS, MASK, light.Metal(0.7, 0.2), light.Emissive((2, 1, 0))],
    np.repeat([0, 1, 2, 4, 0, 0, 3, 1, 2, 0, 4, 0], 2), [light.Sun((0.3, -1, 0.2)), light.PointLight((0.6, 0.7, -0.6))],
    light.PanoramaSky(np.random.default_rng(0).random((8, 16, 3), np.float32)),
)  # fmt: skip


def first_hits():
    """What paths from the texels of a room meet first; their origins and directions, (R, 3) float64."""
    with WaveBaker(painted(ROOM), sheet(ROOM, 8), threads=1) as baker:
        texels, wave, paths = baker.texels, new_wave(RAYS), Paths(baker.scene, baker.texels, baker.options)
        order = (np.arange(RAYS) % len(texels)).astype(np.int32)
        generate(wave, order, 0, RAYS, 1, np.arange(len(texels), dtype=np.int32), paths.charts, paths.surfaces)
        assert scatter(wave, RAYS, paths.surfaces, 100) == RAYS

        def work(query):
            assert trace(wave, RAYS, query.scene, query.packet) == RAYS

        baker.rays_scene.run(work)
    origins, ways = (wave.floats[first : first + 3, :RAYS].T.astype(float) for first in (ORIGIN, DIRECTION))
    return wave.prim_id, wave.floats[NEAR, :RAYS], origins, ways


def test_rays_of_texels_meet_what_brute_force_says():
    prim_id, got, origins, ways = first_hits()
    distances = nearest(ROOM, origins, ways)
    first = np.sort(distances, axis=1)
    assert np.isfinite(first[:, 0]).all()  # nothing leaks out of a closed box
    np.testing.assert_allclose(got, first[:, 0], rtol=1e-4, atol=1e-5)
    met = np.take_along_axis(distances, prim_id[:, None].astype(int), axis=1)[:, 0]
    apart = first[:, 1] - first[:, 0] > 1e-5  # no edge, at which either is right
    assert apart.mean() > 0.99
    assert (met == first[:, 0])[apart].mean() > 0.9995
    assert (prim_id >= 12).mean() > 0.03


@pytest.mark.parametrize("options", [
    {}, {"compaction": "texels"}, {"batch_rays": 1 << 8, "expansion": 3, "threads": 2, "compaction": "none"},
], ids=str)  # fmt: skip
@pytest.mark.parametrize("scene", [LIT, MIXED], ids=["diffuse", "mixed"])
def test_waves_find_the_light_of_the_library_s_baker_to_the_bit_however_rays_are_grouped(scene, options):
    atlas = sheet(scene.mesh, 5)
    with Baker(scene, atlas, threads=1) as baker, WaveBaker(scene, atlas, **{"threads": 1} | options) as waves:
        baker.add(9)
        waves.add(9)
        usual, other = baker.maps, waves.maps
        assert waves.rays == baker.rays > 0
        assert waves.lanes >= waves.rays
    for name in ("direct", "indirect", "environment", "openness", "backs", "variance", "samples"):
        np.testing.assert_array_equal(getattr(usual, name), getattr(other, name))
    assert usual.indirect.max() > 0


def test_compaction_leaves_fewer_lanes_idle():
    used = []
    for compaction in ("none", "texels", "bounces"):
        with WaveBaker(LIT, sheet(BOX, 6, 4), threads=1, compaction=compaction) as waves:
            waves.add(2)
            used.append(waves.rays / waves.lanes)
    assert used[0] < used[1] < used[2] <= 1.0


def test_wanted_texels_get_their_samples_alone_and_the_order_changes_no_bit():
    with WaveBaker(LIT, sheet(BOX, 6), threads=1) as waves, Baker(LIT, sheet(BOX, 6), threads=1) as baker:
        wanted = np.arange(len(waves.texels)) % 3 == 0
        waves.add(16, wanted)
        assert (waves.samples == np.where(wanted, 16, 0)).all()
        waves.add(16, ~wanted)
        baker.add(16)
        np.testing.assert_array_equal(waves.maps.combined, baker.maps.combined)


def test_rays_in_flight_take_no_more_memory_for_a_larger_map():
    small, large = (WaveBaker(replace(LIT, lights=[]), sheet(BOX, size), threads=1, batch_rays=512) for size in (6, 48))
    with small, large:
        small.add(1)
        large.add(1)
        assert small.buffer_bytes == large.buffer_bytes > 0


def test_a_small_sun_in_the_sky_is_found_alike_by_scattering_and_by_aiming_which_has_less_noise():
    texels = np.full((8, 16, 3), 0.02, np.float32)
    texels[2, 3] = 40.0  # a small sun
    walls = quads([floor(1.0), [(-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1)]])
    found = []
    for options in ({}, {"environment": "bsdf"}, {"roulette_from": None}):
        scene = painted(walls, 0.6, sky=light.PanoramaSky(texels))
        with WaveBaker(scene, sheet(walls, 6), threads=1, seed=len(found), **options) as baker:
            baker.add(768)
            lightmap = baker.maps
        error = np.sqrt((standard_error(lightmap) ** 2).sum()) / len(lightmap.samples)
        found.append((lightmap.luminance.mean(), error))
    (mean, error), *others = found
    assert all(abs(other - mean) < 4 * np.hypot(error, other_error) for other, other_error in others)
    assert error < 0.2 * found[1][1]


needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed (extra `peers`)"
)
BOUNCES = 3


def test_a_measured_bake_has_plain_materials_unless_the_scene_s_own_are_asked_for():
    room = {"name": "living_room"}
    own, plain = (planned("raster", "bake", scene=room, asked=asked).point for asked in ({"materials": "own"}, {}))
    mesh = load_mesh(own)
    shown = lit("living_room", mesh, own.camera)
    scene, grey = bake_scene(own, mesh), bake_scene(plain, mesh)
    for name in ("materials", "lights", "sky"):
        assert getattr(scene, name) == getattr(shown, name)
    assert {one.colour for one in grey.materials} == {(0.7, 0.7, 0.7)}
    dark = replace(own, workload_options=replace(own.workload_options, albedo=0.25))
    assert {one.colour for one in bake_scene(dark, mesh).materials if not any(one.emission)} == {(0.25, 0.25, 0.25)}


def sunlit():
    """A box above a floor, beneath a sun and a sky."""
    mesh = joined(cube(0.5), quads([floor(3.0, -0.6)]))
    materials, sky = [light.Lambertian((0.6, 0.5, 0.4))], light.GradientSky((0.3, 0.3, 0.3), (0.5, 0.7, 1.0))
    return light.Scene(mesh, materials, lights=[light.Sun((-0.35, -1.0, 0.25), power=3.0)], sky=sky)


@needs_mitsuba
@pytest.mark.parametrize("room", [shining_room(), sunlit()], ids=["lamp", "sun"])
def test_paths_that_a_round_is_held_against_find_the_same_light_and_as_many_vertices(room):
    try:
        load_mitsuba("llvm_ad_rgb", "this test", 1)
    except InputError as problem:
        pytest.skip(str(problem))
    room = with_plain_light(room)
    with Baker(room, sheet(room.mesh, 8), threads=1, bounces=BOUNCES) as baker:
        theirs = MitsubaPaths(room, baker, 16)
        for _ in range(15):
            theirs.add()
        baker.add(256)
        found = theirs.against(baker.maps, baker.maps)
    assert abs(found["other_light_ratio"] - 1) < 4 * found["other_light_error"]
    assert found["other_light_error"] < 0.01


@xatlas
@needs_mitsuba
def test_a_round_of_a_point_is_held_against_as_many_paths_by_mitsuba():
    point, found = measured(against="mitsuba", samples=4)
    assert set(found.samples) == {"own", "other"} == BAKE.samples(point)
    assert found.results["paths_per_round"] == 4 * found.results["texels"]
    assert {"other_light_ratio", "other_light_error", "best_other_ratio"} <= set(found.results)
    assert "other_rays_per_round" not in found.results


def test_light_that_mitsuba_is_not_handed_is_refused():
    with pytest.raises(InputError, match="expected no PointLight"):
        suns_of([light.PointLight((0, 1, 0))])
    with pytest.raises(InputError, match="expected no Sun"):
        suns_of([light.Sun((0, -1, 0))])
