"""Bakes that go on, what they need, meshes that no map could be made of as they are, and the files of lightmaps."""

import importlib.util
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import trimesh
from PIL import Image

import atra
from atra import light as render
from atra.errors import InputError, MemoryBudgetError
from atra.light import Atlas, Baker, Seams, dilated, save_maps, save_model, toned
from atra.light.lightmaps.finish.export import finished
from atra.light.pictures.files import srgb_of
from atra.light.pictures.finish.states import read_state, write_state
from examples import bake
from tests.baked import baked, cube, painted, sheet
from tests.light.lightmaps.test_light import PLATE
from tests.meshes import joined, quads
from tests.shown import floor

BOX = cube(inwards=True)
COLOURS = np.repeat([(0.7, 0.6, 0.5), (0.2, 0.4, 0.1)], 6, axis=0)
SCENE = painted(BOX, COLOURS, lights=[render.PointLight((0.3, 0.4, 0.1))])
ATLAS = sheet(BOX, 8)


def test_a_bake_goes_on_from_a_file_to_the_bit_and_refuses_that_of_another(tmp_path):
    with Baker(SCENE, ATLAS, threads=1) as baker:
        baker.add(5)
        path = tmp_path / "bake.state"
        write_state(path, baker.state)
    with Baker(SCENE, ATLAS, threads=2) as baker:
        read_state(path, baker.restore, "bake")
        baker.add(11)
        np.testing.assert_array_equal(baker.maps.combined, baked(SCENE, ATLAS, 16).combined)
    for other in (Baker(SCENE, ATLAS, seed=1), Baker(replace(SCENE, lights=[]), ATLAS), Baker(SCENE, sheet(BOX, 6))):
        with other, pytest.raises(InputError, match="cannot be resumed: it is of another scene, atlas, option or"):
            read_state(path, other.restore, "bake")
    path.write_bytes(path.read_bytes()[:100])
    with Baker(SCENE, ATLAS) as baker, pytest.raises(InputError, match="is no state of a bake"):
        read_state(path, baker.restore, "bake")


def test_the_error_of_a_bake_is_that_of_its_map_and_not_the_variance_of_its_samples():
    sky = render.GradientSky((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    mesh = quads([floor(0.5)])
    with Baker(render.Scene.plain(mesh, 0.0, sky=sky), sheet(mesh, 32), threads=1) as baker:
        baker.add(2)
        assert baker.error is None
        baker.add(62)
        lightmap = baker.maps
        error = lightmap.luminance * 6 / 5 - 1
        assert np.sqrt((error**2).mean()) / 1.6 < baker.error < 1.6 * np.sqrt((error**2).mean())
    squared = (5 / 6 * error) ** 2
    assert squared.sum() / 2.5 < lightmap.squared_error(np.arange(len(error))) < 2.5 * squared.sum()
    assert (lightmap.variance / 64).sum() > 4 * squared.sum()


@pytest.mark.skipif(importlib.util.find_spec("OpenEXR") is None, reason="OpenEXR is not installed (extra `bake`)")
def test_maps_are_written_whole_and_read_back(tmp_path):
    import OpenEXR

    lightmap = baked(SCENE, ATLAS, 16)
    written = save_maps(lightmap, str(tmp_path), stitch=False, visible=lightmap.direct[:, 0] > 0.5)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    channels = OpenEXR.File(str(tmp_path / "combined.exr"), separate_channels=True).channels()
    image = np.stack([channels[name].pixels for name in "RGB"], axis=2)
    np.testing.assert_array_equal(image.reshape(-1, 3)[lightmap.texels.number], lightmap.combined)
    shown = np.asarray(Image.open(tmp_path / "combined.png"))
    assert shown.shape == (ATLAS.height, ATLAS.width, 3)
    assert shown.std() > 5
    assert (np.asarray(Image.open(tmp_path / "occupancy.png"))[..., 0] > 0).sum() == len(lightmap.texels)


def test_a_model_shows_elsewhere_albedo_times_light_as_a_picture_would(tmp_path):
    lightmap = baked(SCENE, ATLAS, 16)
    path = save_model(lightmap, SCENE, str(tmp_path / "scene.glb"), exposure=1.5, tone="agx")
    (model,) = trimesh.load(path).geometry.values()
    np.testing.assert_allclose(model.triangles, BOX.triangles(np.arange(12)), atol=1e-6)
    uv = model.visual.uv.reshape(12, 3, 2) * (1, -1) + (0, 1)
    np.testing.assert_allclose(uv * (ATLAS.width, ATLAS.height), ATLAS.uv, atol=1e-3)
    shown = np.asarray(model.visual.material.baseColorTexture.convert("RGB")).reshape(-1, 3)
    light = finished(lightmap, lightmap.combined, Seams.of(BOX, ATLAS)).reshape(-1, 3)[lightmap.texels.number]
    expected = srgb_of(toned(COLOURS[lightmap.texels.prim_id] * light, 1.5, "agx")).astype(int)
    assert np.abs(shown[lightmap.texels.number] - expected).max() <= 1
    assert expected.std() > 20
    json = path.read_bytes()[20:].split(b"\0")[0].decode(errors="replace")
    assert "KHR_materials_unlit" in json
    assert "COLOR_0" not in json
    with pytest.raises(InputError, match=r"ends in \.glb"):
        save_model(lightmap, SCENE, tmp_path / "scene.obj")


def test_panes_of_a_model_are_a_mesh_of_their_own_that_blends(tmp_path):
    scene = painted(BOX, COLOURS, opacity=np.repeat([1.0, 0.4], [8, 4]), lights=SCENE.lights)
    lightmap = baked(scene, ATLAS, 1)
    found = trimesh.load(save_model(lightmap, scene, tmp_path / "scene.glb")).geometry
    assert {name: len(one.faces) for name, one in found.items()} == {"scene": 8, "panes": 4}
    for name, mode in (("scene", "OPAQUE"), ("panes", "BLEND")):
        assert (found[name].visual.material.alphaMode or "OPAQUE") == mode
    shown = np.asarray(found["panes"].visual.material.baseColorTexture).reshape(-1, 4)
    is_pane = lightmap.texels.prim_id >= 8
    np.testing.assert_array_equal(shown[lightmap.texels.number, 3], np.where(is_pane, 102, 255))


def test_images_stay_sharper_in_a_model_than_its_map_is(tmp_path):
    stripes = np.zeros((1, 64, 3), np.float32)
    stripes[:, ::2] = 1.0
    material = render.Lambertian(render.Image(stripes, is_nearest=True))
    mesh = quads([floor(1.0)])
    scene = render.Scene(mesh, [material], uv=[(0, 0), (1, 0), (1, 1), (0, 1)], sky=render.constant_sky(1.0))
    path = save_model(baked(scene, sheet(mesh, 16), 1), scene, tmp_path / "scene.glb", exposure=0, tone="none")
    (model,) = trimesh.load(path).geometry.values()
    shown = np.asarray(model.visual.material.baseColorTexture.convert("RGB"))[..., 0]
    row = shown[len(shown) // 2]
    assert set(row[row.size // 4 : -row.size // 4].tolist()) == {0, 255}
    assert (np.diff(row.astype(int)) != 0).sum() == 63


@pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")
def test_the_example_shows_the_box_and_its_furnace_is_a_geometric_series(tmp_path):
    told = bake.main(["--samples", "16", "--size", "48", "--width", "48", "--height", "48", "--out", str(tmp_path)])
    assert told["furnace"] < 0.01
    assert told["direct"] + told["indirect"] == pytest.approx(1.0)
    clay, *shown = np.split(np.asarray(Image.open(tmp_path / "bake.png"), float)[:, :204], [48, 100, 152], axis=1)
    assert clay.std() > 20
    assert all(one[:, 4:].std() > 20 for one in shown)


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
