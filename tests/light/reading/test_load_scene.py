"""Scenes from glTF and OBJ: what they keep, what they name as left out, and what is refused."""

import base64
import io
import json

import numpy as np
import pytest
from PIL import Image

import atra
from atra import InputError, light, load_mesh
from atra.light.reading.gltf_materials import placement_of
from atra.light.reading.images import MOST_SIDE, read_image
from tests.shown import BLACK, traced

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def png(array, mode=None):
    held = io.BytesIO()
    Image.fromarray(array, mode).save(held, "png")
    return held.getvalue()


def uri(content):
    return "data:application/octet-stream;base64," + base64.b64encode(content).decode()


def tree(**changes):
    """A triangle with normals, texture coordinates, and a material; bytes lie in the file."""
    uv = np.array([[0, 0], [1, 0], [0, 1]], np.float32)
    parts = [
        CORNERS.tobytes(),
        np.tile([0, 0, 1], (3, 1)).astype(np.float32).tobytes(),
        uv.tobytes(),
        np.array([[255, 0, 0, 128]] * 3, np.uint8).tobytes(),
    ]
    starts = np.cumsum([0, *map(len, parts)])
    made = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": int(starts[-1]), "uri": uri(b"".join(parts))}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(a), "byteLength": len(p)} for a, p in zip(starts[:-1], parts, strict=True)
        ],
        "accessors": [
            {"bufferView": k, "componentType": kind, "type": of, "count": 3, **more}
            for k, (kind, of, more) in enumerate(
                [(5126, "VEC3", {}), (5126, "VEC3", {}), (5126, "VEC2", {}), (5121, "VEC4", {"normalized": True})]
            )
        ],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3}, "material": 0}]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 0.5], "metallicFactor": 0.3}}],
        "nodes": [{"mesh": 0, "name": "leaf"}],
        "scenes": [{"nodes": [0]}],
    }  # fmt: skip
    return made | changes


def read(tmp_path, given, **options):
    path = tmp_path / "model.gltf"
    path.write_text(json.dumps(given))
    return light.load_scene(path, **options)


@pytest.mark.parametrize("most", [1, 255])
def test_colours_behind_the_vertices_of_an_obj_are_srgb_and_colour_what_no_mtl_describes(tmp_path, most):
    path, half = tmp_path / "scan.obj", 0.5 * most
    path.write_text(f"v 0 0 0 {most} 0 0\nv 1 0 0 0 {half} 0\nv 0 1 0 0 0 {most}\nv 0 0 1 0 0 0\nf 2 3 1\n")
    scene = light.load_scene(path)
    linear = ((0.5 + 0.055) / 1.055) ** 2.4
    by_corner = scene.colours[scene.mesh.faces[0]]
    assert by_corner == pytest.approx(np.array([[0, linear, 0, 1], [0, 0, 1, 1], [1, 0, 0, 1]]))
    assert scene.materials[0].colour == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("word", ["norm", "map_Bump", "bump"])
def test_an_image_of_normals_is_read_by_each_word_that_exporters_have_for_it_and_heights_are_named(tmp_path, word):
    (tmp_path / "up.png").write_bytes(png(np.full((2, 2, 3), (128, 128, 255), np.uint8)))
    (tmp_path / "high.png").write_bytes(png(np.full((2, 2), 200, np.uint8)))
    path = tmp_path / "tile.obj"
    path.write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n")
    (tmp_path / "m.mtl").write_text(f"newmtl a\n{word} up.png\n")
    scene = light.load_scene(path)
    assert scene.materials[0].normals.texels[0, 0].tolist() == [128, 128, 255]
    assert scene.left_out == ()
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_bump high.png\n")
    with pytest.warns(UserWarning, match="heights of bumps of MTL"):
        assert light.load_scene(path).materials[0].normals is None


def test_an_obj_with_colours_of_some_vertices_alone_has_none(tmp_path):
    path = tmp_path / "scan.obj"
    path.write_text("v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    scene = light.load_scene(path)
    assert scene.colours is None
    assert scene.materials[0].colour == (0.7, 0.7, 0.7)


@pytest.mark.filterwarnings("ignore:.*not used")
def test_a_material_is_what_the_file_says(tmp_path):
    given = tree()
    given["images"] = [{"uri": uri(png(np.full((2, 2, 4), 200, np.uint8)))}]
    given["samplers"] = [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]
    given["textures"] = [{"source": 0, "sampler": 0}]
    given["materials"][0] |= {
        "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": True, "emissiveFactor": [1, 0.5, 0],
        "normalTexture": {"index": 0, "scale": 0.5},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 1e9},
            "KHR_materials_ior": {"ior": 1.33}, "KHR_materials_transmission": {"transmissionFactor": 0.7},
            "KHR_materials_volume": {
                "thicknessFactor": 1.0, "attenuationDistance": 2.0, "attenuationColor": [1, 0.5, 0.25]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.25},
            "KHR_materials_specular": {"specularFactor": 0.75, "specularColorFactor": [2, 1, 0],
                                       "specularTexture": {"index": 0}},
            "KHR_materials_sheen": {},
        },
    }  # fmt: skip
    given["materials"][0]["pbrMetallicRoughness"] |= {"roughnessFactor": 0.6, "baseColorTexture": {"index": 0}}
    scene = read(tmp_path, given)
    (made,) = scene.materials
    assert (made.metallic, made.roughness, made.alpha, made.cutoff) == (0.3, 0.6, "mask", 0.25)
    assert (made.ior, made.transmission, made.is_thin, made.is_double) == (1.33, 0.7, False, True)
    assert made.emission == (1e9, 5e8, 0.0)
    assert made.opacity == 0.5
    assert made.name == "paint"
    assert made.colour.factor == (0.5, 0.25, 1.0, 1.0)
    assert made.colour.wrap == ("clamp", "mirror")
    assert made.colour.is_nearest
    assert made.colour.is_coded
    assert not made.normals.is_coded
    assert made.normals.texels is made.normals.texels
    assert made.normal_scale == 0.5
    np.testing.assert_allclose(made.absorption, np.log([1, 2, 4]) / 2)
    assert (made.coat, made.coat_roughness, made.specular, made.specular_colour) == (0.5, 0.25, 0.75, (2, 1, 0))
    assert scene.left_out == ("KHR_materials_sheen", "textures of KHR_materials_specular")
    np.testing.assert_allclose(scene.colours, np.tile([1, 0, 0, 128 / 255], (3, 1)), atol=1e-6)
    np.testing.assert_array_equal(scene.uv, [[0, 1], [1, 1], [0, 0]])  # v grows upwards here


def test_a_texture_s_transform_turns_scales_and_moves_as_its_extension_says(tmp_path):
    rows = placement_of({"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 3]})
    u, v = 0.3, 0.9  # of the file, where v grows downwards
    ours = np.array(rows) @ [u, 1 - v, 1]
    np.testing.assert_allclose(ours, [0.5 + 3 * v, 1 - (0.25 - 2 * u)], atol=1e-12)


def test_nodes_place_instances_cameras_and_lights(tmp_path):
    given = tree(
        nodes=[
            {"children": [1, 2, 3, 4], "translation": [0, 0, 5], "scale": [-2, 2, 2]},
            {"mesh": 0, "name": "one"},
            {"mesh": 0, "rotation": [0, 0, 1, 0]},
            {"camera": 0, "name": "front"},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"extensions": {"KHR_lights_punctual": {"light": 1}}},
        ],
        scenes=[{"nodes": [0, 5]}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2.0}}],
        extensionsUsed=["KHR_lights_punctual"],
        extensions={"KHR_lights_punctual": {"lights": [
            {"type": "spot", "intensity": 10 * np.pi, "spot": {"outerConeAngle": 0.5}},
            {"type": "point", "intensity": -1.0},
        ]}},
    )  # fmt: skip
    with pytest.warns(UserWarning, match="intensity is not above 0"):
        scene = read(tmp_path, given)
    np.testing.assert_allclose(scene.mesh.vertices[:3], CORNERS * [-2, 2, 2] + [0, 0, 5])
    np.testing.assert_allclose(scene.mesh.vertices[3:], CORNERS * [2, -2, 2] + [0, 0, 5], atol=1e-6)
    corners = scene.mesh.vertices[scene.mesh.faces]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (facing[:, 2] > 0).all()  # mirrored triangles still show their fronts
    (spot,) = scene.lights
    assert isinstance(spot, light.SpotLight)
    assert spot.power == pytest.approx(10.0)
    assert scene.cameras["front"].width == 1440
    assert scene.cameras["front"].eye == (0.0, 0.0, 5.0)
    assert [part.node for part in scene.parts] == [1, 2]
    assert scene.parts[1].first_face == 1


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"extensionsRequired": ["NEW_compression"]}, "requires the extension.*gltf-transform/cli copy"),
        ({"asset": {"version": "1.0"}, "nodes": {"a": {}}}, "it is glTF 1.0, expected 2.0; .*gltf-pipeline"),
        ({"nodes": [{"children": [1]}, {"children": [0], "mesh": 0}]}, "its own ancestor"),
        ({"buffers": [{"byteLength": 3, "uri": "../other.bin"}]}, "outside its folder"),
        ({"buffers": [{"byteLength": 3, "uri": "https://example.org/a.bin"}]}, "outside its folder"),
        ({"nodes": [{"mesh": 7}]}, "names meshes 7"),
        ({"nodes": [{"mesh": 0, "scale": [1e999, 1, 1]}]}, "not finite|no JSON"),
        ({"meshes": [{"primitives": [{"attributes": {"POSITION": 9}}]}]}, "names accessors 9"),
    ],
)
def test_what_cannot_be_trusted_is_refused_by_name(tmp_path, changes, reason):
    (tmp_path.parent / "other.bin").write_bytes(b"abc")
    with pytest.raises(InputError, match=reason):
        read(tmp_path, tree(**changes))


def test_a_glb_of_version_1_is_refused_by_its_version_and_a_tool_that_converts(tmp_path):
    path = tmp_path / "old.glb"
    path.write_bytes(b"glTF" + np.array([1, 22, 2, 0], np.uint32).tobytes() + b"{}")
    for load in (light.load_scene, load_mesh):
        with pytest.raises(InputError, match=r"it is glTF 1\.0, expected 2\.0; convert it, .*gltf-pipeline"):
            load(path)


def test_an_image_outside_the_folder_is_refused_and_one_that_is_missing_is_named(tmp_path):
    given = tree(textures=[{"source": 0}], images=[{"uri": "../secret.png"}])
    given["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    with pytest.raises(InputError, match="outside its folder"):
        read(tmp_path, given)
    with pytest.warns(UserWarning, match="image 0"):
        scene = read(tmp_path, given | {"images": [{"uri": "missing.png"}]})
    assert scene.materials[0].colour == (0.5, 0.25, 1.0)


def test_coordinates_that_are_missing_or_nan_cost_the_texture_alone(tmp_path):
    given = tree(textures=[{"source": 0}], images=[{"uri": uri(png(np.zeros((1, 1, 3), np.uint8)))}])
    given["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    del given["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    with pytest.warns(UserWarning, match="without texture coordinates"):
        assert read(tmp_path, given).materials[0].colour == (0.5, 0.25, 1.0)
    broken = tree()
    broken["buffers"][0]["uri"] = uri(
        base64.b64decode(broken["buffers"][0]["uri"].partition(",")[2])[:72] + np.full(6, np.nan, np.float32).tobytes()
        + b"\xff" * 12
    )  # fmt: skip
    with pytest.warns(UserWarning, match="TEXCOORD_0 that is not finite"):
        assert np.isfinite(read(tmp_path, broken).uv).all()


@pytest.mark.parametrize("kind", ["16 bits", "palette", "grey", "odd"])
def test_images_of_every_kind_become_eight_bits(kind):
    arrays = {"16 bits": np.full((3, 5), 32896, np.uint16), "grey": np.full((3, 5), 128, np.uint8),
              "odd": np.full((3, 5, 3), 128, np.uint8)}  # fmt: skip
    if kind == "palette":
        held = io.BytesIO()
        Image.fromarray(np.full((3, 5, 3), 128, np.uint8)).quantize(4).save(held, "png")
        content = held.getvalue()
    else:
        content = png(arrays[kind])
    texels = read_image(content, True)
    assert texels.shape == (3, 5, 3)
    assert texels.dtype == np.uint8
    assert np.abs(texels.astype(int) - 128).max() <= 1


def test_a_long_image_is_made_smaller_in_linear_light():
    stripes = np.zeros((2, 2 * MOST_SIDE, 3), np.uint8)
    stripes[:, ::2] = 255
    texels = read_image(png(stripes), True)
    assert texels.shape == (1, MOST_SIDE, 3)
    assert (texels == 188).all()  # half the light, coded


def test_an_obj_s_materials_come_with_their_colours_textures_and_opacity(tmp_path):
    (tmp_path / "wood.png").write_bytes(png(np.full((2, 2, 3), 100, np.uint8)))
    (tmp_path / "m.mtl").write_text(
        "newmtl wood\nKd 0.5 0.5 0.5\nmap_Kd wood.png\nPr 0.3\nnewmtl lamp\nKe 4 3 2\nKd 0 0 0\nrefl x.png\n"
    )
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
        "usemtl wood\nf 1/1 2/2 3/3\nusemtl lamp\nf 2/1 4/2 3/3\n"
    )
    with pytest.warns(UserWarning, match="refl of MTL"):
        scene = light.load_scene(tmp_path / "m.obj")
    assert scene.mesh.triangle_count == 2
    named = {one.name: one for one in scene.materials}
    assert named["lamp"].emission == (4.0, 3.0, 2.0)
    assert named["wood"].roughness == 0.3
    assert named["wood"].colour.factor == (0.5, 0.5, 0.5, 1.0)


SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def obj(tmp_path, text, mtl="newmtl m\nmap_Kd wood.png\n"):
    (tmp_path / "wood.png").write_bytes(png(np.full((2, 2, 3), 100, np.uint8)))
    (tmp_path / "m.mtl").write_text(mtl)
    (tmp_path / "m.obj").write_text("mtllib m.mtl\n" + text)
    return light.load_scene(tmp_path / "m.obj")


@pytest.mark.parametrize("gap", [" ", " \\\n"], ids=["one line", "continued line"])
def test_each_corner_of_an_obj_has_the_texture_coordinate_that_it_names(gap, tmp_path):
    text = SQUARE + "".join(f"vt {k}e-1 0.5\n" for k in range(1, 6)) + f"usemtl m\nf 1/1{gap}2/2 3/3\nf 1/5 3/3 4/4\n"
    scene = obj(tmp_path, text)
    np.testing.assert_allclose(scene.uv[scene.mesh.faces][..., 0], [[0.1, 0.2, 0.3], [0.5, 0.3, 0.4]], rtol=1e-6)
    expected = load_mesh(tmp_path / "m.obj")
    np.testing.assert_array_equal(scene.mesh.vertices[scene.mesh.faces], expected.vertices[expected.faces])
    assert len(scene.mesh.vertices) == 5


@pytest.mark.filterwarnings("ignore:.*not used")
def test_an_obj_of_quads_keeps_texture_coordinates_and_normals_and_flat_faces_stay_flat(tmp_path):
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0.6 0.8\nusemtl m\n"
    scene = obj(tmp_path, text + "f 1/1/1 2/2/1 3/3/1 4/4/1\nf -1 -2 -3 -4\n")
    assert scene.mesh.triangle_count == 4
    np.testing.assert_allclose(scene.normals[scene.mesh.faces[:2]], np.tile([0, 0.6, 0.8], (2, 3, 1)), rtol=1e-6)
    np.testing.assert_allclose(scene.normals[scene.mesh.faces[2:]], np.tile([0, 0, -1], (2, 3, 1)), rtol=1e-6)
    mapped, plain = (scene.materials[k] for k in scene.face_materials[[0, 3]])
    assert isinstance(mapped.colour, light.Image)
    assert plain.colour == pytest.approx((0.7, 0.7, 0.7))
    assert scene.left_out == ("textures without texture coordinates",)


def test_a_part_of_an_obj_that_begins_late_keeps_its_image(tmp_path):
    text = SQUARE + "v 0 0 5\nv 1 0 5\nv 0 1 5\nvt 0 0\nvt 1 0\nvt 0 1\nf 1 2 3\nusemtl m\nf 5/1 6/2 7/3\n"
    scene = obj(tmp_path, text)
    assert isinstance(scene.materials[scene.face_materials[1]].colour, light.Image)
    np.testing.assert_array_equal(scene.uv[scene.mesh.faces[1]], [[0, 0], [1, 0], [0, 1]])


def test_what_an_obj_s_material_says_in_vain_is_named_and_glass_takes_its_filter(tmp_path):
    mtl = "newmtl m\nKa 1 1 1\nKs 0.5 0.5 0.5\nTf 1 0.5 0\nNs 250\nnewmtl g\nillum 7\nKd 0 0 0\nTf 1 0.5 0\nKs 0 0 0\n"
    with pytest.warns(UserWarning, match="Ka of MTL; Ks of MTL; Tf of MTL; material 'x', which no MTL describes"):
        scene = obj(tmp_path, SQUARE + "usemtl m\nf 1 2 3\nusemtl g\nf 1 2 4\nusemtl x\nf 1 3 4\n", mtl)
    assert scene.materials[1].colour == (1.0, 0.5, 0.0)
    assert scene.materials[1].transmission == 1.0


def test_a_texture_coordinate_that_an_obj_has_not_is_named_and_costs_the_texture_of_its_face(tmp_path):
    with pytest.warns(UserWarning, match="1 corners name texture coordinates that the file has not"):
        scene = obj(tmp_path, SQUARE + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\nf 1/1 3/1 4/2\n")
    assert [isinstance(scene.materials[k].colour, light.Image) for k in scene.face_materials] == [True, False]


def test_an_obj_with_paths_of_its_author_s_machine_takes_the_files_beside_it(tmp_path):
    text = SQUARE + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
    scene = obj(tmp_path, text, "newmtl m\nmap_Kd C:\\art\\wood.png\n")
    assert isinstance(scene.materials[0].colour, light.Image)
    (tmp_path.parent / "stone.png").write_bytes(png(np.full((2, 2, 3), 100, np.uint8)))
    with pytest.warns(UserWarning, match=r"image '\.\./stone\.png', because it names 'stone\.png', which is no file"):
        scene = obj(tmp_path, text, "newmtl m\nmap_Kd ../stone.png\n")
    assert scene.materials[0].colour == pytest.approx((0.7, 0.7, 0.7))


@pytest.mark.parametrize("has_colours", [False, True])
def test_a_material_without_light_shows_its_colour_image_and_colours_of_vertices_as_they_are(tmp_path, has_colours):
    given = tree(textures=[{"source": 0}], images=[{"uri": uri(png(np.full((2, 2, 4), 188, np.uint8)))}])
    given["materials"][0] |= {"extensions": {"KHR_materials_unlit": {}}, "alphaMode": "BLEND"}
    given["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    if not has_colours:
        del given["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
    scene = read(tmp_path, given)
    (made,) = scene.materials
    assert (made.emission, made.specular, made.colour.factor) == ((0.5, 0.25, 1.0), 0.0, (0, 0, 0, 1))
    assert scene.left_out == ()
    opaque = given["materials"][0] | {"alphaMode": "OPAQUE"}
    scene = read(tmp_path, given | {"materials": [opaque]}, sky=BLACK)
    camera = atra.Camera((0.2, 0.2, 1), (0.2, 0.2, 0), fov_y_degrees=1, width=2, height=2)
    image = traced(scene, camera, 4)
    shown = 0.503 * np.array([0.5, 0.25, 1.0]) * ((1.0, 0.0, 0.0) if has_colours else 1.0)  # the vertices are red
    np.testing.assert_allclose(image, np.broadcast_to(shown, image.shape), rtol=0.01)


def test_a_leaf_may_have_thousands_of_instances(tmp_path):
    places = np.arange(24_000, dtype=np.float32).reshape(-1, 3)
    given = tree()
    given["buffers"].append({"byteLength": places.nbytes, "uri": uri(places.tobytes())})
    given["bufferViews"].append({"buffer": 1, "byteLength": places.nbytes})
    given["accessors"].append({"bufferView": 4, "componentType": 5126, "type": "VEC3", "count": len(places)})
    given["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 4}}}
    scene = read(tmp_path, given)
    assert scene.mesh.vertices[::3].tolist() == places.tolist()
