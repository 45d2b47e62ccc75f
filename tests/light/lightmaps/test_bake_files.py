"""Bakes that are edited or go on, and the files of lightmaps."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image

from atra import light as render
from atra.errors import InputError
from atra.light import Baker, Seams, save_maps, save_model, toned
from atra.light.lightmaps.finish.export import finished
from atra.light.pictures.files import srgb_of
from atra.light.pictures.finish.states import read_state, write_state
from examples import bake
from tests.baked import baked, cube, painted, sheet
from tests.meshes import quads
from tests.shown import floor

BOX = cube(inwards=True)
COLOURS = np.repeat([(0.7, 0.6, 0.5), (0.2, 0.4, 0.1)], 6, axis=0)
SCENE = painted(BOX, COLOURS, lights=[render.PointLight((0.3, 0.4, 0.1))])
ATLAS = sheet(BOX, 8)


def test_an_edit_starts_anew():
    dark = replace(SCENE, lights=[render.PointLight((0.3, 0.4, 0.1), power=0.25)])
    with Baker(SCENE, ATLAS, threads=1) as baker:
        baker.add(32)
        baker.update(dark)
        baker.add(32)
        np.testing.assert_array_equal(baker.maps.combined, baked(dark, ATLAS, 32).combined)
        with pytest.raises(InputError, match="target is 0"):
            baker.advance(0)


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


def test_the_error_of_a_bake_is_that_of_its_map():
    sky = render.GradientSky((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    mesh = quads([floor(0.5)])
    with Baker(render.Scene.plain(mesh, 0.0, sky=sky), sheet(mesh, 32), threads=1) as baker:
        baker.add(2)
        assert baker.error is None
        baker.add(62)
        true = np.sqrt(((baker.maps.luminance * 6 / 5 - 1) ** 2).mean())
        assert true / 1.6 < baker.error < 1.6 * true


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
