"""Scenes from glTF: what they keep, what they name as left out, and what is refused."""

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


def png(array):
    held = io.BytesIO()
    (array if isinstance(array, Image.Image) else Image.fromarray(array)).save(held, "png")
    return held.getvalue()


def uri(content, kind="application/octet-stream"):
    return f"data:{kind};base64," + base64.b64encode(content).decode()


def with_rows(given, *arrays):
    """Accessors of further float32 rows, or bytes; returns their numbers."""
    content = base64.b64decode(given["buffers"][0]["uri"].partition(",")[2])
    numbers = []
    for array in arrays:
        given["bufferViews"].append({"buffer": 0, "byteOffset": len(content), "byteLength": array.nbytes})
        numbers.append(len(given["accessors"]))
        given["accessors"].append({
            "bufferView": len(given["bufferViews"]) - 1, "componentType": 5121 if array.dtype == np.uint8 else 5126,
            "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[array.shape[1]], "count": len(array),
        })  # fmt: skip
        content += array.tobytes()
    given["buffers"] = [{"byteLength": len(content), "uri": uri(content)}]
    return numbers


def tree(**changes):
    """A triangle with normals, texture coordinates, colours, and a material; bytes lie in the file."""
    made = {
        "asset": {"version": "2.0"}, "buffers": [{"uri": uri(b"")}], "bufferViews": [], "accessors": [],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "COLOR_0": 3}, "material": 0}]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1, 0.5], "metallicFactor": 0.3}}],
        "nodes": [{"mesh": 0, "name": "leaf"}],
        "scenes": [{"nodes": [0]}],
    }  # fmt: skip
    normals, uv = np.tile(np.float32([0, 0, 1]), (3, 1)), np.float32([[0, 0], [1, 0], [0, 1]])
    with_rows(made, CORNERS, normals, uv, np.array([[255, 0, 0, 128]] * 3, np.uint8))
    made["accessors"][3]["normalized"] = True
    return made | changes


def read(tmp_path, given, **options):
    path = tmp_path / "model.gltf"
    path.write_text(json.dumps(given))
    return light.load_scene(path, **options)


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


def image_of(kind):
    grey = np.full((3, 5), 128, np.uint8)
    return {
        "16 bits": np.full((3, 5), 32896, np.uint16), "grey": grey, "odd": np.stack([grey] * 3, axis=2),
        "palette": Image.fromarray(np.stack([grey] * 3, axis=2)).quantize(4),
    }[kind]  # fmt: skip


@pytest.mark.parametrize("kind", ["16 bits", "palette", "grey", "odd"])
def test_images_of_every_kind_become_eight_bits(kind):
    texels = read_image(png(image_of(kind)), True)
    assert (texels.shape, texels.dtype) == ((3, 5, 3), np.uint8)
    assert np.abs(texels.astype(int) - 128).max() <= 1


def test_a_long_image_is_made_smaller_in_linear_light():
    stripes = np.zeros((2, 2 * MOST_SIDE, 3), np.uint8)
    stripes[:, ::2] = 255
    texels = read_image(png(stripes), True)
    assert texels.shape == (1, MOST_SIDE, 3)
    assert (texels == 188).all()  # half the light, coded
