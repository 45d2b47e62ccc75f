"""The wing's baker in waves: its rays against brute force, and its light beside that of the library's baker."""

from dataclasses import replace

import numpy as np
import pytest

from atra import light
from atra.light import Baker
from atra.light.lightmaps.paths import Paths
from experiments.light.wave_baker import WaveBaker
from experiments.light.waves_kernels import DIRECTION, NEAR, ORIGIN, generate, new_wave, scatter, trace
from tests.baked import cube, painted, sheet
from tests.light.lightmaps.test_light import BOX, LIT
from tests.meshes import joined

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
