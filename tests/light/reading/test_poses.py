"""Skins, morph targets, instances and compression: what stands in a scene is what the plain file says."""

import base64
import sys

import numpy as np
import pytest

from atra import InputError, light, load_mesh
from tests.light.reading.test_load_scene import CORNERS, read, tree, uri, with_rows


def skinned():
    """Two joints, moved since they were bound: one by (0, 0, 5), one turned by a quarter about x; the third vertex
    belongs half to each."""
    given = tree()
    joints = np.array([[0, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0.5, 0.5, 0, 0]], np.float32)
    bound = np.tile(np.eye(4), (2, 1, 1))
    bound[0, 2, 3] = -1.0  # joint 0 was bound at z = 1
    numbers = with_rows(given, joints, weights, bound.transpose(0, 2, 1).reshape(2, 16).astype(np.float32))
    given["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": numbers[0], "WEIGHTS_0": numbers[1]}
    given["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]}, {"children": [2], "translation": [0, 0, 4]},
        {"translation": [0, 0, 2]}, {"rotation": [0.5**0.5, 0, 0, 0.5**0.5]},
    ]  # fmt: skip
    given["scenes"] = [{"nodes": [0, 1, 3]}]
    return given | {"skins": [{"joints": [2, 3], "inverseBindMatrices": numbers[2]}]}


@pytest.mark.filterwarnings("error")
def test_a_skin_stands_where_its_joints_put_it_whatever_the_place_of_its_node(tmp_path):
    scene = read(tmp_path, skinned())
    expected = [[0, 0, 5], [1, 0, 0], [0, 0.5, 3.0]]  # (0, 1, 5) and (0, 0, 1) at half each
    np.testing.assert_allclose(scene.mesh.vertices, expected, atol=1e-6)
    np.testing.assert_allclose(load_mesh(tmp_path / "model.gltf").vertices, expected, atol=1e-6)
    half = np.array([0, -0.5, 0.5]) * 2**0.5
    np.testing.assert_allclose(scene.normals, [[0, 0, 1], [0, -1, 0], half], atol=1e-6)


def test_a_skin_whose_joint_is_not_there_is_refused_by_name(tmp_path):
    given = skinned()
    given["skins"][0]["joints"][1] = 7
    with pytest.raises(InputError, match="skin 0 has the joint 7, which is no node of the scene"):
        read(tmp_path, given)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("place", ["meshes", "nodes"])
def test_morph_targets_count_by_the_weights_of_the_node_or_the_mesh(tmp_path, place):
    given = tree()
    one, other, turned = with_rows(given, 2 * CORNERS, CORNERS + np.float32(1), np.tile(np.float32([0, 1, -1]), (3, 1)))
    targets = [{"POSITION": one, "NORMAL": turned}, {"POSITION": other}]
    given["meshes"][0]["primitives"][0]["targets"] = targets
    given["meshes"][0]["weights"] = [0.0, 0.0]
    given[place][0]["weights"] = [0.5, 2.0]
    scene = read(tmp_path, given)
    np.testing.assert_allclose(scene.mesh.vertices, 2 * CORNERS + 2 * (CORNERS + 1), rtol=1e-6)
    np.testing.assert_allclose(load_mesh(tmp_path / "model.gltf").vertices, scene.mesh.vertices)
    np.testing.assert_allclose(scene.normals, np.tile([0, 0.5**0.5, 0.5**0.5], (3, 1)), atol=1e-6)


def test_a_leaf_may_have_thousands_of_instances(tmp_path):
    places, given = np.arange(24_000, dtype=np.float32).reshape(-1, 3), tree()
    (number,) = with_rows(given, places)
    given["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": number}}}
    assert read(tmp_path, given).mesh.vertices[::3].tolist() == places.tolist()


KTX2 = base64.b64decode(
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAACAAAAaAAAACwAAACUAAAAJAAAAAAAAAAAAAAAAAAAAAAAAAC4AAAA"
    "AAAAACMAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AAAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMg"
    "VW5pdmVyc2FsIDIuMTAAACi1L/0gQNUAAIAXmUzmP7WKAJcChfs/GmUDAwAA5JkoEIAL"
)
"""8 x 8 texels, UASTC: the upper half is (200, 100, 50), the lower (20, 40, 220)."""

NAMES = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0")


def numbers_of(given):
    """The rows of the four attributes of `tree`."""
    content = base64.b64decode(given["buffers"][0]["uri"].partition(",")[2])
    kinds = ((np.float32, 3), (np.float32, 3), (np.float32, 2), (np.uint8, 4))
    return [
        np.frombuffer(content, kind, 3 * size, view["byteOffset"]).reshape(3, size)
        for view, (kind, size) in zip(given["bufferViews"], kinds, strict=True)
    ]


def draco(given):
    package = pytest.importorskip("DracoPy")
    position, normal, uv, colour = numbers_of(given)
    coded = package.encode(
        position, np.array([[0, 1, 2]]), normals=normal.astype(float), tex_coord=uv.astype(float), colors=colour
    )
    ids = {0: "POSITION", 1: "NORMAL", 2: "COLOR_0", 3: "TEXCOORD_0"}  # by Draco's types
    numbers = {ids[one["attribute_type"]]: one["unique_id"] for one in package.decode(coded).attributes}
    given["buffers"] = [{"byteLength": len(coded), "uri": uri(coded)}]
    given["bufferViews"] = [{"buffer": 0, "byteLength": len(coded)}]
    for accessor in given["accessors"]:
        del accessor["bufferView"]
    given["accessors"].append({"componentType": 5123, "type": "SCALAR", "count": 3})
    extension = {"bufferView": 0, "attributes": numbers}
    given["meshes"][0]["primitives"][0] |= {"indices": 4, "extensions": {"KHR_draco_mesh_compression": extension}}
    return given | {"extensionsRequired": ["KHR_draco_mesh_compression"]}


def meshopt(given):
    package = pytest.importorskip("meshopt")
    buffers = []
    for view, rows in zip(given["bufferViews"], numbers_of(given), strict=True):
        coded = package.encode_gltf_buffer(rows, "ATTRIBUTES")
        stride = rows.shape[1] * rows.itemsize
        extension = {"buffer": len(buffers), "byteLength": len(coded), "byteStride": stride, "count": 3}
        extension["mode"] = "ATTRIBUTES"
        view |= {"buffer": 4, "byteStride": stride, "extensions": {"EXT_meshopt_compression": extension}}
        buffers.append({"byteLength": len(coded), "uri": uri(coded)})
    fallback = given["buffers"][0] | {"extensions": {"EXT_meshopt_compression": {"fallback": True}}}
    del fallback["uri"]
    return given | {"buffers": [*buffers, fallback], "extensionsRequired": ["EXT_meshopt_compression"]}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("pack", [draco, meshopt])
def test_a_packed_scene_is_that_of_the_plain_file_with_its_coordinates_normals_and_colours(tmp_path, pack):
    plain, packed = read(tmp_path, tree()), read(tmp_path, pack(tree()))
    for name in ("normals", "uv", "colours"):
        one, other = (getattr(scene, name)[scene.mesh.faces] for scene in (plain, packed))
        np.testing.assert_allclose(one, other, atol=2e-3)
    one, other = (scene.mesh.vertices[scene.mesh.faces] for scene in (plain, packed))
    np.testing.assert_allclose(one, other, atol=2e-3)
    np.testing.assert_allclose(load_mesh(tmp_path / "model.gltf").vertices, packed.mesh.vertices)


@pytest.mark.parametrize("pack", [draco, meshopt])
def test_what_unpacks_a_file_is_named_where_it_is_missing(tmp_path, pack, monkeypatch):
    given, name = pack(tree()), {draco: "DracoPy", meshopt: "meshopt"}[pack]
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=f"package {name} reads: pip install {name}; or .*gltf-transform/cli"):
        read(tmp_path, given)


def test_a_view_that_claims_more_than_its_bytes_may_hold_is_refused(tmp_path):
    given = meshopt(tree())
    given["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = 10**9
    with pytest.raises(InputError, match="claims 1,000,000,000 compressed elements"):
        read(tmp_path, given)


def test_a_basis_image_is_decoded_or_its_package_named(tmp_path, monkeypatch):
    given = tree(images=[{"uri": uri(KTX2)}], textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}])
    given["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    given["extensionsRequired"] = ["KHR_texture_basisu"]
    with monkeypatch.context() as changed:
        changed.setitem(sys.modules, "opengl_basisu", None)
        with pytest.warns(UserWarning, match="pip install opengl_basisu; or .*gltf-transform/cli ktxdecompress"):
            assert not isinstance(read(tmp_path, given).materials[0].colour, light.Image)
    pytest.importorskip("opengl_basisu")
    texels = read(tmp_path, given).materials[0].colour.texels
    np.testing.assert_array_equal(texels[[0, 7], 3], [[200, 100, 50, 255], [20, 40, 220, 255]])
