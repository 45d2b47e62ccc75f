"""What becomes of meshes and sizes that no map could be made of as they are."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

import atra
from atra import light as render
from atra.errors import MemoryBudgetError
from atra.light import Atlas, Baker, Seams, dilated
from tests.baked import baked, cube, painted, sheet
from tests.light.lightmaps.test_light import PLATE
from tests.meshes import joined, quads
from tests.shown import floor


def test_edges_of_three_triangles_are_lit_and_not_stitched():
    flat, upright = [(-1, 0, 3), (1, 0, 3), (1, 0, 1), (-1, 0, 1)], [(-1, 0, 1), (1, 0, 1), (1, 2, 1), (-1, 2, 1)]
    fan = quads([floor(1.0), flat, upright])
    atlas = sheet(fan, 6)
    assert Seams.of(fan, atlas).texel.shape[1] == 0
    two = atra.Mesh(fan.vertices[:8], fan.faces[:4])
    assert Seams.of(two, sheet(two, 6)).texel.shape[1] > 0
    assert baked(painted(fan, sky=render.constant_sky(1.0)), atlas, 4).environment.max() > 0.9


def test_texels_inside_of_something_are_not_valid_and_take_their_light_from_others():
    mesh = joined(PLATE, cube(0.25))  # half a plate is in a closed box, and the box is cut in two by it
    scene = painted(mesh, 0.0, sky=render.constant_sky(1.0))
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
        Baker(painted(PLATE), Atlas.of_uv(uv, 1 << 14, 1 << 14), threads=1).build()
    with (
        Baker(painted(PLATE), sheet(PLATE, 4), threads=1) as baker,
        pytest.raises(MemoryBudgetError, match="500,000 probes"),
    ):
        baker.probes(np.zeros((500_000, 3)))


def test_a_bake_asks_for_the_memory_that_it_takes(monkeypatch):
    asked = []
    monkeypatch.setattr("atra.light.lightmaps.baker.check_needed_bytes", lambda needed, *_: asked.append(needed))
    plate = Atlas.of_uv(np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]]), 512, 512)
    baked(painted(PLATE), sheet(PLATE, 4), 1)  # compiles kernels
    tracemalloc.start()
    with Baker(painted(PLATE), plate, threads=1) as baker:
        baker.add(1)
        lightmap = baker.maps
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(lightmap.samples) == 512 * 512
    assert asked[-1] / 1.5 < peak < asked[-1]
