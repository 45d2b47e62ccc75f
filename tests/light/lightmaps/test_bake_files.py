"""Progressive bakes, their snapshots, and the files of lightmaps."""

import importlib.util
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra import light as render
from atra.errors import InputError
from atra.light import Baker, BakeScene, ProgressiveBake, Surface, save_maps, save_model
from atra.light.lightmaps.maps import LIGHTS
from examples import bake
from experiments.commands import making
from experiments.configure import configure
from experiments.workloads.bake.measure import bake_scene
from experiments.workloads.rounds import load_mesh
from scenes.lit.lighting import lit
from tests.baked import baked, cube, sheet
from tests.commands.test_command_line import run
from tests.folders import ROOT
from tests.points import configured, planned

BOX = cube(inwards=True)
COLOURS = np.repeat([(0.7, 0.6, 0.5), (0.2, 0.4, 0.1)], 6, axis=0)
SCENE = BakeScene(BOX, Surface.plain(BOX, COLOURS), [render.PointLight((0.3, 0.4, 0.1))])
ATLAS = sheet(BOX, 8)
LONG_S = 600


def alive():
    return [thread.name for thread in threading.enumerate() if thread.name == "atra-bake"]


@pytest.mark.slow
def test_a_snapshot_is_the_bake_that_stopped_there():
    with Baker(SCENE, ATLAS, threads=1, expansion=4) as baker, ProgressiveBake(baker, 64) as bake:
        bake.look(atra.Camera((0, 0, 0), (1, 0.2, 0.1), width=32, height=32))
        seen = [one for _ in range(2000) if (one := bake.snapshot()) is not None]
        assert bake.wait(LONG_S)
        seen.append(bake.snapshot())
    assert (seen[-1].samples == 64).all()
    whole = {count: baked(SCENE, ATLAS, count).combined for count in {*np.unique(seen[0].samples), 64} if count}
    for one in (seen[0], seen[-1]):
        for count, expected in whole.items():
            np.testing.assert_array_equal(one.combined[one.samples == count], expected[one.samples == count])
    assert not alive()


def test_an_edit_starts_anew_and_a_bake_that_is_left_leaves_no_thread():
    dark = replace(SCENE, lights=[render.PointLight((0.3, 0.4, 0.1), power=0.25)])
    with Baker(SCENE, ATLAS, threads=1) as baker:
        with ProgressiveBake(baker, 32) as bake:
            assert bake.wait(LONG_S)
            bake.update(dark)
            assert bake.wait(LONG_S)
            np.testing.assert_array_equal(bake.snapshot().combined, baked(dark, ATLAS, 32).combined)
        with ProgressiveBake(baker, 1 << 20) as bake:
            assert alive()
            assert not bake.wait(0.01)
        assert not alive()
    nothing = pytest.raises(InputError, match="target is 0")
    with Baker(SCENE, ATLAS, threads=1) as baker, ProgressiveBake(baker, 0) as bake, nothing:
        bake.wait(LONG_S)


@pytest.mark.skipif(importlib.util.find_spec("OpenEXR") is None, reason="OpenEXR is not installed (extra `bake`)")
def test_maps_are_written_whole_and_read_back(tmp_path):
    import OpenEXR

    lightmap = baked(SCENE, ATLAS, 16)
    written = save_maps(lightmap, tmp_path, stitch=False, visible=lightmap.direct[:, 0] > 0.5)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    channels = OpenEXR.File(str(tmp_path / "combined.exr"), separate_channels=True).channels()
    image = np.stack([channels[name].pixels for name in "RGB"], axis=2)
    np.testing.assert_array_equal(image.reshape(-1, 3)[lightmap.texels.number], lightmap.combined)
    shown = np.asarray(Image.open(tmp_path / "combined.png"))
    assert shown.shape == (ATLAS.height, ATLAS.width, 3)
    assert shown.std() > 5
    assert (np.asarray(Image.open(tmp_path / "occupancy.png"))[..., 0] > 0).sum() == len(lightmap.texels)


def test_a_model_opens_elsewhere_with_its_map_and_colours(tmp_path):
    lightmap = baked(SCENE, ATLAS, 16)
    path = save_model(lightmap, SCENE, tmp_path / "scene.glb")
    (model,) = trimesh.load(path).geometry.values()
    np.testing.assert_allclose(model.triangles, BOX.triangles(np.arange(12)), atol=1e-6)
    uv = model.visual.uv.reshape(12, 3, 2) * (1, -1) + (0, 1)
    np.testing.assert_allclose(uv * (ATLAS.width, ATLAS.height), ATLAS.uv, atol=1e-3)
    colours = model.visual.vertex_attributes["color"].reshape(12, 3, -1)[:, 0, :3]
    np.testing.assert_allclose(colours / 255, COLOURS, atol=0.003)
    shown = np.asarray(model.visual.material.baseColorTexture.convert("RGB"), float)
    light = lightmap.luminance
    place = np.unravel_index(lightmap.texels.number, shown.shape[:2])
    assert np.corrcoef(shown[place].sum(axis=1), light)[0, 1] > 0.9
    json = path.read_bytes()[20:].split(b"\0")[0].decode(errors="replace")
    assert all(word in json for word in ("KHR_materials_unlit", "MOZ_lightmap", "TEXCOORD_1"))
    with pytest.raises(InputError, match=r"ends in \.glb"):
        save_model(lightmap, SCENE, tmp_path / "scene.obj")


def test_panes_of_a_model_are_a_mesh_of_their_own_that_blends(tmp_path):
    surface = replace(SCENE.surface, opacity=np.repeat([1.0, 0.4], [8, 4]).astype(np.float32))
    scene = replace(SCENE, surface=surface)
    path = save_model(baked(scene, ATLAS, 1), scene, tmp_path / "scene.glb")
    found = trimesh.load(path).geometry
    assert {name: len(one.faces) for name, one in found.items()} == {"scene": 8, "panes": 4}
    for name, mode, opacity in (("scene", "OPAQUE", 255), ("panes", "BLEND", 102)):
        assert (found[name].visual.material.alphaMode or "OPAQUE") == mode
        colours = found[name].visual.vertex_attributes["color"]
        assert (colours[:, 3] == opacity).all() if colours.shape[1] == 4 else opacity == 255


def test_the_verb_bakes_a_scene_in_its_own_materials_and_measurements_in_plain_ones():
    assert configure(["+verb=bake"]).workload.options.materials == "own"
    for path in (ROOT / "conf" / "sweep").glob("bake*.yaml"):
        workload = configure([f"sweep={path.stem}"]).workload.options
        assert getattr(workload, "materials", "plain") == "plain", path
    room = {"name": "living_room"}
    own, plain = (planned("raster", "bake", scene=room, asked=asked).point for asked in ({"materials": "own"}, {}))
    mesh = load_mesh(own)
    shown = lit("living_room", mesh, own.camera)
    colours = Surface.of(shown)
    scene = bake_scene(own, mesh)
    for name in ("albedo", "emission", "opacity"):
        np.testing.assert_array_equal(getattr(scene.surface, name), getattr(colours, name))
    assert scene.surface.panes.any()
    assert (scene.lights, scene.sky) == (shown.lights, shown.sky)
    grey = bake_scene(plain, mesh)
    np.testing.assert_array_equal(grey.surface.albedo, np.full_like(colours.albedo, 0.7))
    assert not grey.surface.emission.any()
    dark = replace(own, workload_options=replace(own.workload_options, albedo=0.25))
    np.testing.assert_array_equal(bake_scene(dark, mesh).surface.albedo, np.full_like(colours.albedo, 0.25))


@pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")
def test_the_command_bakes_a_scene_by_name_under_the_sky_of_a_file(tmp_path):
    (tmp_path / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n" + bytes([128] * 4))
    told = run(
        tmp_path, "bake", "scene=cornell_box", "output=out", "workload.size=48", "workload.final_samples=4",
        "workload.priority=true", "width=32", "height=32", "workload.sky=sky.hdr", "workload.lights=grid",
        "workload.adaptive=true",
    )  # fmt: skip
    assert told.returncode == 0, told.stderr
    assert "texels in 18 charts on 48 x 48" in told.stdout
    assert {"combined.exr", "combined.png", "charts.png", "scene.glb"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert np.asarray(Image.open(tmp_path / "out" / "environment.png")).max() > 0


def test_the_bar_of_an_adaptive_bake_comes_to_its_end(monkeypatch):
    shown, kept = [], []
    monkeypatch.setattr(making.Progress, "update", lambda self, task, completed: shown.append(completed))
    views = SimpleNamespace(keep=lambda name, lightmap: kept.append(name))
    dark = replace(SCENE, surface=Surface.plain(BOX, 0.02))
    with Baker(dark, ATLAS, threads=1, adaptive=True) as baker:
        making._bake(baker, 1024, views)
        assert baker.samples.mean() < 1024
    assert shown == sorted(shown)
    assert shown[-1] == 1.0
    assert kept == ["view_1", "view_16", "view_256"]


@pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")
@pytest.mark.parametrize("workload", [{}, {"denoise": True}])
def test_an_interrupted_bake_writes_what_there_is_whole_and_shows_what_the_camera_saw(
    tmp_path, monkeypatch, capsys, workload
):
    if workload:
        pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    passes, advance = [], Baker.advance

    def interrupted(self, target, stop=None):
        passes.append(target)
        if len(passes) == 3:
            raise KeyboardInterrupt
        return advance(self, target, stop)

    monkeypatch.setattr(Baker, "advance", interrupted)
    monkeypatch.setattr(
        "experiments.commands.messages.picture_restriction", lambda name: f"so says the owner of {name}"
    )
    asked = {"size": 32, "final_samples": 64, **workload}
    folder = making.run_bake(configured("raster", "bake", (32, 24), asked=asked, output=str(tmp_path / "out")))
    assert capsys.readouterr().err == "not to be published: so says the owner of cornell_box\n"
    lights = {f"{name}.{end}" for name in (*LIGHTS, "openness") for end in ("exr", "png")}
    others = {"occupancy.png", "charts.png", "view_clay.png", "view_1.png", "view.png", "scene.glb"}
    assert {path.name for path in folder.iterdir()} == lights | others
    assert {np.asarray(Image.open(folder / f"view{name}.png")).shape for name in ("", "_clay", "_1")} == {(24, 32, 3)}
    seen = [np.asarray(Image.open(folder / name), float) for name in ("view_1.png", "view.png")]
    assert seen[1].std() > 10
    assert not alive()


@pytest.mark.skipif(importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)")
def test_the_example_shows_the_box_and_its_furnace_is_a_geometric_series(tmp_path):
    told = bake.main(["--samples", "16", "--size", "48", "--width", "48", "--height", "48", "--out", str(tmp_path)])
    assert told["furnace"] < 0.01
    assert told["direct"] + told["indirect"] == pytest.approx(1.0)
    clay, *shown = np.split(np.asarray(Image.open(tmp_path / "bake.png"), float)[:, :204], [48, 100, 152], axis=1)
    assert clay.std() > 20
    assert all(one[:, 4:].std() > 20 for one in shown)
