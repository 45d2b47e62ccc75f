"""Rays of a bake against brute force, and what becomes of meshes and sizes that no map could be made of as they are."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

import atra
from atra import light as render
from atra.errors import MemoryBudgetError
from atra.light import Atlas, Baker, BakeScene, Seams, Surface, dilated
from atra.light.lightmaps.batches import new_batch
from atra.light.lightmaps.bounces_kernels import scatter, trace_kernel
from atra.light.lightmaps.gather.tables import tables_of
from atra.light.lightmaps.gather.tables_kernels import DIRECTION, ORIGIN
from atra.light.lightmaps.samples_kernels import generate
from tests.baked import baked, cube, sheet
from tests.light.lightmaps.test_light import PLATE
from tests.machine import WIDEST
from tests.meshes import joined, quads
from tests.shown import floor

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


def first_hits(packet_width):
    """What paths from the texels of a room meet first; their origins and directions, (R, 3) float64."""
    scene = BakeScene(ROOM)
    with Baker(scene, sheet(ROOM, 8), threads=1, packet_width=packet_width) as baker:
        texels, tables, batch = baker.texels, tables_of(scene, baker.texels, baker.options), new_batch(RAYS)
        order = (np.arange(RAYS) % len(texels)).astype(np.int32)
        lit, samples = (texels.prim_id, texels.number), np.arange(len(texels), dtype=np.int32)
        generate(batch, order, 0, RAYS, 1, samples, lit, tables)
        scatter(batch, RAYS, 0)
        trace = trace_kernel(packet_width, False)

        def work(query):
            assert trace(batch, RAYS, tables, None, 0, query.scene, query.packet) == RAYS

        baker.rays_scene.run(work)
    origins, ways = (batch.floats[first : first + 3, :RAYS].T.astype(float) for first in (ORIGIN, DIRECTION))
    return batch, origins, ways


def test_rays_of_texels_meet_what_brute_force_says():
    batch, origins, ways = first_hits(1)
    distances = nearest(ROOM, origins, ways)
    first = np.sort(distances, axis=1)
    assert np.isfinite(first[:, 0]).all()  # nothing leaks out of a closed box
    np.testing.assert_allclose(batch.distance, first[:, 0], rtol=1e-4, atol=1e-5)
    met = np.take_along_axis(distances, batch.prim_id[:, None].astype(int), axis=1)[:, 0]
    apart = first[:, 1] - first[:, 0] > 1e-5  # no edge, at which either is right
    assert apart.mean() > 0.99
    assert (met == first[:, 0])[apart].mean() > 0.9995
    assert (batch.prim_id >= 12).mean() > 0.03


def test_packets_meet_what_single_rays_meet_but_where_a_ray_is_at_an_edge():
    single, origins, ways = first_hits(1)
    packets, *_ = first_hits(WIDEST)
    different = single.prim_id != packets.prim_id
    first = np.sort(nearest(ROOM, origins, ways), axis=1)
    at_an_edge = first[:, 1] - first[:, 0] <= 1e-5
    assert at_an_edge[different].all()
    assert different.sum() < 1e-3 * RAYS
    np.testing.assert_allclose(packets.distance, single.distance, rtol=1e-4, atol=1e-5)


def test_edges_of_three_triangles_are_lit_and_not_stitched():
    flat, upright = [(-1, 0, 3), (1, 0, 3), (1, 0, 1), (-1, 0, 1)], [(-1, 0, 1), (1, 0, 1), (1, 2, 1), (-1, 2, 1)]
    fan = quads([floor(1.0), flat, upright])
    atlas = sheet(fan, 6)
    assert Seams.of(fan, atlas).texel.shape[1] == 0
    two = atra.Mesh(fan.vertices[:8], fan.faces[:4])
    assert Seams.of(two, sheet(two, 6)).texel.shape[1] > 0
    assert baked(BakeScene(fan, sky=render.constant_sky(1.0)), atlas, 4).environment.max() > 0.9


def test_texels_inside_of_something_are_not_valid_and_take_their_light_from_others():
    mesh = joined(PLATE, cube(0.25))  # half a plate is in a closed box, and the box is cut in two by it
    scene = BakeScene(mesh, Surface.plain(mesh, 0.0), sky=render.constant_sky(1.0))
    lightmap = baked(scene, sheet(mesh, 12), 64)
    on_plate = lightmap.texels.prim_id < 2
    inside = on_plate & (np.abs(lightmap.texels.positions[:, [0, 2]]).max(axis=1) < 0.2)
    assert inside.sum() > 4
    assert not lightmap.valid[inside].any()
    outside = on_plate & (np.abs(lightmap.texels.positions[:, [0, 2]]).max(axis=1) > 0.3)
    assert lightmap.valid[outside].all()
    filled = dilated(lightmap.texels, lightmap.combined, lightmap.valid).reshape(-1, 3)[lightmap.texels.number]
    assert lightmap.combined[inside].max() == 0.0
    assert filled[inside].min() > 0.2


def test_a_map_and_probes_that_are_too_large_are_refused_before_they_are_made(monkeypatch):
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1 << 30))
    uv = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], float)
    with pytest.raises(MemoryBudgetError, match="use a smaller map"):
        Baker(BakeScene(PLATE), Atlas.of_uv(uv, 1 << 14, 1 << 14), threads=1).build()
    with (
        Baker(BakeScene(PLATE), sheet(PLATE, 4), threads=1) as baker,
        pytest.raises(MemoryBudgetError, match="500,000 probes"),
    ):
        baker.probes(np.zeros((500_000, 3)))


def test_a_bake_asks_for_the_memory_that_it_takes(monkeypatch):
    asked = []
    monkeypatch.setattr("atra.light.lightmaps.baker.check_needed_bytes", lambda needed, *_: asked.append(needed))
    plate = Atlas.of_uv(np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]), 512, 512)
    baked(BakeScene(PLATE), sheet(PLATE, 4), 1, expansion=1)  # compiles kernels
    tracemalloc.start()
    with Baker(BakeScene(PLATE), plate, threads=1, batch_rays=1 << 12, expansion=1) as baker:
        baker.add(1)
        lightmap = baker.maps
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(lightmap.samples) == 512 * 512
    assert asked[-1] / 1.5 < peak < asked[-1]
