"""A glTF with its lightmap: nothing of the file is lost, and a browser shows what we show."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.ndimage import minimum_filter

import atra
from atra import light
from atra.command.main import main
from atra.errors import InputError
from atra.files.gltf.tree import gltf_tree
from atra.light import Atlas, Baker, atlas_of, lit_view, save_lit_model, save_model
from atra.light.lightmaps.finish.export import exposure_of, finished
from atra.light.lightmaps.finish.seams import Seams
from tests.baked import looked_up
from tests.browser import chromium

LAMP = {"type": "point", "intensity": 30.0, "name": "lamp"}


@pytest.fixture
def source(tmp_path):
    """`room.glb`: a textured floor, and two instances of a textured box, one of them mirrored; a lamp."""
    texels = (np.indices((8, 8)).sum(0) % 2 * 100 + 100).astype(np.uint8)
    image = Image.fromarray(np.stack([texels, texels // 2, texels // 3], -1)).resize((64, 64), 0)
    made = []
    for shape, colour in ((trimesh.creation.box((4, 0.2, 4)), 255), (trimesh.creation.box((1, 1, 1)), 180)):
        corners = trimesh.Trimesh(shape.triangles.reshape(-1, 3), np.arange(len(shape.faces) * 3).reshape(-1, 3))
        material = trimesh.visual.material.PBRMaterial(
            name=f"paint {colour}", baseColorTexture=image, baseColorFactor=[colour, colour, 255, 255],
            metallicFactor=0.0, roughnessFactor=0.9,
        )  # fmt: skip
        uv = corners.vertices[:, [0, 2]] * 0.4 + 0.2
        corners.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
        made.append(corners)
    scene = trimesh.Scene()
    scene.add_geometry(made[0], node_name="the floor", geom_name="floor")
    for name, x, mirror in (("left", -0.9, 1), ("right", 0.9, -1)):
        place = np.diag([mirror, 1.0, 1.0, 1.0])
        place[:3, 3] = x, 0.65, 0.0
        if name == "left":
            scene.add_geometry(made[1], node_name=name, geom_name="box", transform=place)
        else:
            scene.graph.update(frame_to=name, geometry="box", matrix=place)

    def with_lamp(tree):
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [LAMP]}}
        tree["nodes"].append({
            "name": "lamp", "translation": [0.3, 3, 1.5], "extensions": {"KHR_lights_punctual": {"light": 0}},
        })  # fmt: skip
        tree["nodes"][0].setdefault("children", []).append(len(tree["nodes"]) - 1)

    path = tmp_path / "room.glb"
    path.write_bytes(scene.export(file_type="glb", include_normals=True, tree_postprocessor=with_lamp))
    return path


def baked(source, path, samples=16, size=128):
    scene = light.load_scene(source, sky=light.constant_sky(0.5))
    with Baker(scene, Atlas.unwrap(scene.mesh, size), threads=1) as baker:
        while baker.advance(samples):
            ...
        lightmap = baker.maps
    return scene, lightmap, save_lit_model(lightmap, scene, source, path)


def tree_of(path):
    return gltf_tree(path.read_bytes(), "glb")


def test_all_of_the_file_is_kept_and_each_material_has_the_map(source, tmp_path):
    scene, lightmap, files = baked(source, tmp_path / "lit.glb")
    assert [path.name for path in files] == ["lit_light.exr", "lit_light.png", "lit.glb", "lit.html"]
    stops = np.clip(np.log2(exposure_of(lightmap)), -8, 8)
    assert f'value="{stops:.1f}"' in files[-1].read_text()
    before, after = tree_of(source), tree_of(tmp_path / "lit.glb")
    same = ("name", "children", "matrix", "translation", "extensions", "camera")
    assert [{key: node.get(key) for key in same} for node in after["nodes"]] == [
        {key: node.get(key) for key in same} for node in before["nodes"]
    ]
    assert after["extensions"] == before["extensions"]
    with pytest.warns(UserWarning, match="not used: MOZ_lightmap"):
        read = light.load_scene(tmp_path / "lit.glb")
    assert [part.name for part in read.parts] == [part.name for part in scene.parts]
    assert len(read.lights) == 1
    corners = [one.mesh.vertices[one.mesh.faces] for one in (scene, read)]
    np.testing.assert_allclose(*corners, atol=1e-6)
    uv = [one.uv[one.mesh.faces] for one in (scene, read)]
    np.testing.assert_allclose(*uv, atol=1e-6)
    for part in read.parts:
        given = after["meshes"][part.mesh]["primitives"][part.primitive]
        material = after["materials"][given["material"]]
        assert material["extensions"]["MOZ_lightmap"]["texCoord"] == 1
        assert "baseColorTexture" in material["pbrMetallicRoughness"]
        assert {"TEXCOORD_0", "TEXCOORD_1", "NORMAL"} <= given["attributes"].keys()
    # The scene reads TEXCOORD_1 bottom up, and the atlas counts texels from the top.
    known = np.isfinite(lightmap.texels.atlas.uv).all(axis=(1, 2))
    places = read.second_uv[read.mesh.faces]
    places = np.stack([places[..., 0], 1.0 - places[..., 1]], axis=-1) * 128
    np.testing.assert_allclose(places[known], lightmap.texels.atlas.uv[known], atol=1e-3)


def test_second_coordinates_of_a_file_are_its_map_s_where_they_do(source, tmp_path):
    _, lightmap, _ = baked(source, tmp_path / "lit.glb", samples=1)
    with pytest.warns(UserWarning, match="not used: MOZ_lightmap"):
        read = light.load_scene(tmp_path / "lit.glb")
    for charts in ("auto", "file"):
        np.testing.assert_allclose(atlas_of(read, 128, charts).uv, lightmap.texels.atlas.uv, atol=1e-3)
    every = read.parts[1]
    partly = read.second_uv.copy()
    partly[every.first_vertex : every.first_vertex + every.vertices] = 0.0
    for second_uv, told in ((partly, f"second uv of '{every.name}' are missing"), (read.second_uv % 0.3, "overlap")):
        scene = replace(read, second_uv=second_uv)
        with pytest.raises(InputError, match=told):
            atlas_of(scene, 128, "file")
        with pytest.warns(UserWarning, match=f"charts by xatlas, as .*{told}"):
            atlas = atlas_of(scene, 128)
        np.testing.assert_array_equal(atlas.uv, Atlas.unwrap(scene.mesh, 128).uv)
    for options, told in (
        ({"charts": "own"}, "expected one of auto, file, xatlas"), ({"texels_per_unit": -1.0}, "texels_per_unit is -1"),
        ({"charts": "file", "texels_per_unit": 2.0}, "charts of the file have a size of their own"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=told):
            atlas_of(read, 128, **options)
    with pytest.raises(InputError, match="no second uv"):
        atlas_of(replace(read, second_uv=None), 128, "file")


def test_what_was_not_baked_is_refused(source, tmp_path):
    scene, lightmap, _ = baked(source, tmp_path / "lit.glb", samples=1)
    with pytest.raises(InputError, match=r"expected a name that ends in \.glb"):
        save_lit_model(lightmap, scene, source, tmp_path / "lit.gltf")
    with pytest.raises(InputError, match="of another mesh"):
        save_lit_model(lightmap, light.load_scene(source), source, tmp_path / "other.glb")
    with pytest.raises(InputError, match="scene is a Mesh, expected the Scene that load_scene read"):
        save_lit_model(lightmap, scene.mesh, source, tmp_path / "other.glb")


@pytest.mark.slow
def test_a_browser_shows_from_the_page_alone_what_we_show(source, tmp_path):
    scene, lightmap, _ = baked(source, tmp_path / "lit.glb", samples=64, size=256)
    size, eye, target = 400, (1.5, 2.5, 3.5), (0.0, 0.3, 0.0)
    camera = atra.Camera(eye, target, fov_y_degrees=45.0, width=size, height=size)
    with light.HybridRenderer(scene, camera, threads=1) as renderer:
        hits, albedo = renderer.tracer.trace((0.5, 0.5)), renderer.layers().albedo
    atlas = lightmap.texels.atlas
    expected = albedo * looked_up(hits, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    page = tmp_path / "alone" / "page.html"
    page.parent.mkdir()
    (tmp_path / "lit.html").rename(page)
    with chromium("--use-angle=swiftshader", "--enable-unsafe-swiftshader") as browser:
        tab = browser.new_page(viewport={"width": size, "height": size})
        asked = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(page.as_uri())
        tab.wait_for_function("window.isReady", timeout=60_000)
        tab.evaluate("([eye, target]) => { stops.value = 0; look(eye, target) }", [eye, target])
        tab.evaluate("document.querySelector('label').remove()")
        shot = tmp_path / "shown.png"
        tab.screenshot(path=shot)
        before = (tmp_path / "shown.png").read_bytes()
        tab.mouse.move(200, 200)
        tab.mouse.down()
        tab.mouse.move(260, 200, steps=4)
        tab.mouse.up()
        tab.mouse.wheel(0, 200)
        assert tab.screenshot() != before
    assert asked == [page.as_uri()]
    shown = linear(np.asarray(Image.open(shot).convert("RGB")))
    seen = minimum_filter(hits.hit, 3)  # a browser blends pixels of the silhouette with the background
    error = np.abs(shown - np.minimum(expected, 1.0))[seen]
    assert shown[seen].mean() == pytest.approx(np.minimum(expected, 1.0)[seen].mean(), rel=0.02)
    assert np.median(error) < 0.01


def test_an_unlit_copy_keeps_the_nodes_and_shows_what_the_lit_view_shows(source, tmp_path):
    scene, lightmap, _ = baked(source, tmp_path / "lit.glb", samples=64, size=256)
    camera = atra.Camera((1.5, 2.5, 3.5), (0.0, 0.3, 0.0), fov_y_degrees=45.0, width=200, height=200)
    with atra.RasterTracer(scene.mesh, camera, threads=1) as tracer:
        hits = tracer.trace()
    atlas = lightmap.texels.atlas
    view = lit_view(hits, scene, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    path = save_model(lightmap, scene, tmp_path / "unlit.glb", source, exposure=-1.0)
    before, after = tree_of(source), tree_of(path)
    same = ("name", "children", "matrix", "translation", "extensions", "camera")
    assert [{key: node.get(key) for key in same} for node in after["nodes"]] == [
        {key: node.get(key) for key in same} for node in before["nodes"]
    ]
    assert len(after["images"]) == 1
    assert {one["name"] for one in after["materials"]} == {one["name"] for one in before["materials"]}
    assert all(
        one["attributes"].keys() == {"POSITION", "TEXCOORD_0"} for m in after["meshes"] for one in m["primitives"]
    )
    read = light.load_scene(path)
    with light.HybridRenderer(read, camera, threads=1) as renderer:
        renderer.add(1)
        shown = renderer.image
    inside = minimum_filter(hits.hit, 5)
    assert np.median(np.abs(shown - light.toned(view, -1.0, "neutral"))[inside]) < 0.01
    with pytest.raises(InputError, match="of another mesh"):
        save_model(lightmap, read, tmp_path / "other.glb", source)


def linear(levels):
    coded = levels / 255.0
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def test_the_command_bakes_a_gltf_into_a_model_that_keeps_its_materials_and_a_page(source, tmp_path, monkeypatch):
    given = "--out", str(tmp_path / "out"), "--size", "48", "--samples", "2", "--threads", "1"
    monkeypatch.setattr(sys, "argv", ["atra", "bake", str(source), *given])
    assert main() == 0
    assert {"scene.glb", "lit.glb", "lit.html", "lit_light.exr"} <= {one.name for one in (tmp_path / "out").iterdir()}
    tree, before = (gltf_tree(one.read_bytes(), "glb") for one in (tmp_path / "out" / "lit.glb", source))
    assert {one["name"] for one in tree["materials"]} == {one["name"] for one in before["materials"]}
    shown = [tree["meshes"][node["mesh"]] for node in tree["nodes"] if "mesh" in node]
    assert len(shown) == 3
    assert all("TEXCOORD_1" in one["attributes"] for mesh in shown for one in mesh["primitives"])


def accessors(tree):
    """How often meshes name each accessor."""
    named = [
        number for mesh in tree["meshes"] for one in mesh["primitives"]
        for number in (*one["attributes"].values(), *([one["indices"]] if "indices" in one else []))
    ]  # fmt: skip
    return set(named)


def test_a_lit_model_has_consecutive_sets_of_coordinates_and_no_geometry_but_its_own(source, tmp_path):
    def bare(tree):
        for mesh in tree["meshes"]:
            for one in mesh["primitives"]:
                del one["attributes"]["TEXCOORD_0"]
        for material in tree["materials"]:
            del material["pbrMetallicRoughness"]["baseColorTexture"]

    loaded = trimesh.load(source)
    plain = tmp_path / "plain.glb"
    plain.write_bytes(loaded.export(file_type="glb", include_normals=True, tree_postprocessor=bare))
    for path in (source, plain):
        scene, _, _ = baked(path, tmp_path / "lit.glb", samples=1, size=64)
        tree = tree_of(tmp_path / "lit.glb")
        for mesh in tree["meshes"]:
            for one in mesh["primitives"]:
                sets = sorted(name for name in one["attributes"] if name.startswith("TEXCOORD"))
                assert sets == [f"TEXCOORD_{k}" for k in range(len(sets))]
                assert len(sets) == 2
        assert sorted(node["mesh"] for node in tree["nodes"] if "mesh" in node) == list(range(len(tree["meshes"])))
        assert accessors(tree) == set(range(len(tree["accessors"])))
        views = {one["bufferView"] for one in tree["accessors"] + tree["images"]}
        assert views == set(range(len(tree["bufferViews"])))
        with pytest.warns(UserWarning, match="not used: MOZ_lightmap"):
            read = light.load_scene(tmp_path / "lit.glb")
        np.testing.assert_allclose(
            read.mesh.vertices[read.mesh.faces], scene.mesh.vertices[scene.mesh.faces], atol=1e-6
        )
