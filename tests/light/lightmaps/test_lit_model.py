"""A glTF with its lightmap: nothing of the file is lost, what breaks rules is put right, and a browser shows it."""

import json
import sys
import warnings
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
from tests.light.reading.test_load_scene import uri, with_rows

KEPT_BY_NODES = ("name", "children", "matrix", "translation", "extensions", "camera")


@pytest.fixture(scope="module")
def source(tmp_path_factory):
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
    scene.geometry["box"] = made[1]
    for name, x, mirror in (("left", -0.9, 1), ("right", 0.9, -1)):
        place = np.diag([mirror, 1.0, 1.0, 1.0])
        place[:3, 3] = x, 0.65, 0.0
        scene.graph.update(frame_to=name, geometry="box", matrix=place)

    def with_lamp(tree):
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        lamp = {"type": "point", "intensity": 30.0, "name": "lamp"}
        tree["extensions"] = {"KHR_lights_punctual": {"lights": [lamp]}}
        tree["nodes"].append({
            "name": "lamp", "translation": [0.3, 3, 1.5], "extensions": {"KHR_lights_punctual": {"light": 0}},
        })  # fmt: skip
        tree["nodes"][0].setdefault("children", []).append(len(tree["nodes"]) - 1)

    path = tmp_path_factory.mktemp("lit") / "room.glb"
    path.write_bytes(scene.export(file_type="glb", include_normals=True, tree_postprocessor=with_lamp))
    return path


def baked(source, path, samples=1, size=64):
    scene = light.load_scene(source, sky=light.constant_sky(0.5))
    with Baker(scene, Atlas.unwrap(scene.mesh, size), threads=1) as baker:
        while baker.advance(samples):
            ...
        lightmap = baker.maps
    return scene, lightmap, save_lit_model(lightmap, scene, source, path)


@pytest.fixture(scope="module")
def lit(source):
    """The scene, its lightmap of 256 x 256 texels, and the files `lit...` beside `source`."""
    return baked(source, source.parent / "lit.glb", 64, 256)


def read_again(path):
    with pytest.warns(UserWarning, match="not used: MOZ_lightmap"):
        return light.load_scene(path)


def tree_of(path):
    return gltf_tree(path.read_bytes(), "glb")


def assert_keeps_nodes(after, before):
    kept = [[{key: node.get(key) for key in KEPT_BY_NODES} for node in tree["nodes"]] for tree in (after, before)]
    assert kept[0] == kept[1]


def corners_of(scene, values=None):
    return (scene.mesh.vertices if values is None else values)[scene.mesh.faces]


def test_all_of_the_file_is_kept_and_each_material_has_the_map(source, lit):
    scene, lightmap, files = lit
    assert [path.name for path in files] == ["lit_light.exr", "lit_light.png", "lit.glb", "lit.html"]
    stops = np.clip(np.log2(exposure_of(lightmap)), -8, 8)
    assert f'value="{stops:.1f}"' in files[-1].read_text()
    before, after, read = tree_of(source), tree_of(files[2]), read_again(files[2])
    assert_keeps_nodes(after, before)
    assert after["extensions"] == before["extensions"]
    assert [part.name for part in read.parts] == [part.name for part in scene.parts]
    assert len(read.lights) == 1
    np.testing.assert_allclose(corners_of(read), corners_of(scene), atol=1e-6)
    np.testing.assert_allclose(corners_of(read, read.uv), corners_of(scene, scene.uv), atol=1e-6)
    for part in read.parts:
        given = after["meshes"][part.mesh]["primitives"][part.primitive]
        material = after["materials"][given["material"]]
        assert material["extensions"]["MOZ_lightmap"]["texCoord"] == 1
        assert "baseColorTexture" in material["pbrMetallicRoughness"]
        assert {"TEXCOORD_0", "TEXCOORD_1", "NORMAL"} <= given["attributes"].keys()
    # The scene reads TEXCOORD_1 bottom up, and the atlas counts texels from the top.
    known = np.isfinite(lightmap.texels.atlas.uv).all(axis=(1, 2))
    places = (corners_of(read, read.second_uv) * (1, -1) + (0, 1)) * 256
    np.testing.assert_allclose(places[known], lightmap.texels.atlas.uv[known], atol=2e-3)


def test_second_coordinates_of_a_file_are_its_map_s_where_they_do(lit):
    read = read_again(lit[2][2])
    for charts in ("auto", "file"):
        np.testing.assert_allclose(atlas_of(read, 256, charts).uv, lit[1].texels.atlas.uv, atol=2e-3)
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


def test_what_was_not_baked_is_refused(source, lit, tmp_path):
    scene, lightmap, _ = lit
    for given, name, told in (
        (scene, "lit.gltf", r"expected a name that ends in \.glb"), (light.load_scene(source), "a.glb", "another mesh"),
        (scene.mesh, "a.glb", "scene is a Mesh, expected the Scene that load_scene read"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=told):
            save_lit_model(lightmap, given, source, tmp_path / name)
    with pytest.raises(InputError, match="of another mesh"):
        save_model(lightmap, light.load_scene(source), tmp_path / "other.glb", source)


def linear(levels):
    coded = levels / 255.0
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


@pytest.mark.slow
def test_a_browser_shows_from_the_page_alone_what_we_show(lit, tmp_path):
    scene, lightmap, files = lit
    size, eye, target = 400, (1.5, 2.5, 3.5), (0.0, 0.3, 0.0)
    camera = atra.Camera(eye, target, fov_y_degrees=45.0, width=size, height=size)
    with light.HybridRenderer(scene, camera, threads=1) as renderer:
        hits, albedo = renderer.tracer.trace((0.5, 0.5)), renderer.layers().albedo
    atlas = lightmap.texels.atlas
    expected = albedo * looked_up(hits, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    page = tmp_path / "page.html"
    page.write_bytes(files[-1].read_bytes())
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
        before = shot.read_bytes()
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


def test_an_unlit_copy_keeps_the_nodes_and_shows_what_the_lit_view_shows(source, lit, tmp_path):
    scene, lightmap, _ = lit
    camera = atra.Camera((1.5, 2.5, 3.5), (0.0, 0.3, 0.0), fov_y_degrees=45.0, width=200, height=200)
    with atra.RasterTracer(scene.mesh, camera, threads=1) as tracer:
        hits = tracer.trace()
    atlas = lightmap.texels.atlas
    view = lit_view(hits, scene, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    path = save_model(lightmap, scene, tmp_path / "unlit.glb", source, exposure=-1.0)
    before, after = tree_of(source), tree_of(path)
    assert_keeps_nodes(after, before)
    assert len(after["images"]) == 1
    assert {one["name"] for one in after["materials"]} == {one["name"] for one in before["materials"]}
    primitives = [one for mesh in after["meshes"] for one in mesh["primitives"]]
    assert all(one["attributes"].keys() == {"POSITION", "TEXCOORD_0"} for one in primitives)
    with light.HybridRenderer(light.load_scene(path), camera, threads=1) as renderer:
        renderer.add(1)
        shown = renderer.image
    inside = minimum_filter(hits.hit, 5)
    assert np.median(np.abs(shown - light.toned(view, -1.0, "neutral"))[inside]) < 0.01


def test_the_command_bakes_a_gltf_into_a_model_that_keeps_its_materials_and_a_page(source, tmp_path, monkeypatch):
    given = "--out", str(tmp_path / "out"), "--size", "48", "--samples", "2", "--threads", "1"
    monkeypatch.setattr(sys, "argv", ["atra", "bake", str(source), *given])
    assert main() == 0
    assert {"scene.glb", "lit.glb", "lit.html", "lit_light.exr"} <= {one.name for one in (tmp_path / "out").iterdir()}
    tree, before = tree_of(tmp_path / "out" / "lit.glb"), tree_of(source)
    assert {one["name"] for one in tree["materials"]} == {one["name"] for one in before["materials"]}


def test_a_lit_model_has_consecutive_sets_of_coordinates_and_no_geometry_but_its_own(source, tmp_path):
    def bare(tree):
        for mesh in tree["meshes"]:
            for one in mesh["primitives"]:
                del one["attributes"]["TEXCOORD_0"]
        for material in tree["materials"]:
            del material["pbrMetallicRoughness"]["baseColorTexture"]

    plain = tmp_path / "plain.glb"
    plain.write_bytes(trimesh.load(source).export(file_type="glb", include_normals=True, tree_postprocessor=bare))
    for path in (source, plain):
        scene, _, _ = baked(path, tmp_path / "lit.glb")
        tree = tree_of(tmp_path / "lit.glb")
        primitives = [one for mesh in tree["meshes"] for one in mesh["primitives"]]
        for one in primitives:
            assert {name for name in one["attributes"] if "TEX" in name} == {"TEXCOORD_0", "TEXCOORD_1"}
        named = {number for one in primitives for number in (*one["attributes"].values(), one.get("indices", 0))}
        assert sorted(node["mesh"] for node in tree["nodes"] if "mesh" in node) == list(range(len(tree["meshes"])))
        assert named == set(range(len(tree["accessors"])))
        views = {one["bufferView"] for one in tree["accessors"] + tree["images"]}
        assert views == set(range(len(tree["bufferViews"])))
        np.testing.assert_allclose(corners_of(read_again(tmp_path / "lit.glb")), corners_of(scene), atol=1e-6)


def loose(source):
    """The tree of a GLB whose buffer lies in its text, and the bytes of that."""
    tree = tree_of(source)
    binary = source.read_bytes()[-tree["buffers"][0]["byteLength"] :]
    tree["buffers"] = [{"byteLength": len(binary), "uri": uri(binary)}]
    return tree, binary


def test_what_a_file_has_against_the_rules_of_glb_is_put_right(source, tmp_path):
    """Rows of animations one after the other need no stride, and images lie inside."""
    tree, binary = loose(source)
    numbers = with_rows(tree, np.float32([[0.0], [1.0]]), np.float32([[0, 0, 0], [0, 1, 0]]))
    for number, stride in zip(numbers, (4, 12), strict=True):
        tree["bufferViews"][tree["accessors"][number]["bufferView"]]["byteStride"] = stride
    target = {"node": next(k for k, node in enumerate(tree["nodes"]) if "mesh" in node), "path": "translation"}
    sampler = dict(zip(("input", "output"), numbers, strict=True))
    tree["animations"] = [{"samplers": [sampler], "channels": [{"sampler": 0, "target": target}]}]
    for image in tree["images"]:
        view = tree["bufferViews"][image.pop("bufferView")]
        image["uri"] = uri(binary[view["byteOffset"] :][: view["byteLength"]], image.pop("mimeType"))
    path = tmp_path / "other.gltf"
    path.write_text(json.dumps(tree))
    with pytest.warns(UserWarning, match="not used: animations"):
        baked(path, tmp_path / "lit.glb")
    after = tree_of(tmp_path / "lit.glb")
    (sampler,) = after["animations"][0]["samplers"]
    for key in ("input", "output"):
        assert "byteStride" not in after["bufferViews"][after["accessors"][sampler[key]]["bufferView"]]
    assert all("bufferView" in one and "uri" not in one for one in after["images"])
    assert {one["mimeType"] for one in after["images"]} == {"image/png"}


def test_instances_have_nodes_and_light_of_their_own(source, tmp_path):
    tree, _ = loose(source)
    moved, turned = with_rows(tree, np.float32([[0, 0, 0], [0, 0, 1.2]]), np.float32([[0, 0, 0, 1], [0, 2, 0, 2]]))
    left = next(node for node in tree["nodes"] if node.get("name") == "left")
    left["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moved, "ROTATION": turned}}}
    tree["extensionsUsed"].append("EXT_mesh_gpu_instancing")
    path = tmp_path / "many.gltf"
    path.write_text(json.dumps(tree))
    scene, lightmap, _ = baked(path, tmp_path / "lit.glb")
    assert scene.mesh.triangle_count == 48
    save_model(lightmap, scene, tmp_path / "unlit.glb", path)
    for name in ("lit.glb", "unlit.glb"):
        after = tree_of(tmp_path / name)
        assert "EXT_mesh_gpu_instancing" not in json.dumps(after)
        with warnings.catch_warnings(action="ignore"):
            read = light.load_scene(tmp_path / name)
        corners = [np.sort(corners_of(one).reshape(-1, 3), axis=0) for one in (scene, read)]
        np.testing.assert_allclose(*corners, atol=1e-5)
        meshes = [node["mesh"] for node in after["nodes"] if "mesh" in node]
        assert len(set(meshes)) == len(meshes) == 4
