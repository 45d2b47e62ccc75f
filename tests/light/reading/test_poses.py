"""Skins, morph targets and instances: vertices and normals stand where joints, weights and places put them."""

import base64

import numpy as np
import pytest

from atra import InputError, load_mesh
from tests.light.reading.test_load_scene import CORNERS, read, tree, uri


def with_rows(given, *arrays):
    """Accessors of further float32 rows, or bytes; returns their numbers."""
    content = base64.b64decode(given["buffers"][0]["uri"].partition(",")[2])
    numbers = []
    for array in arrays:
        given["bufferViews"].append({"buffer": 0, "byteOffset": len(content), "byteLength": array.nbytes})
        kind = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[array.shape[1]]
        numbers.append(len(given["accessors"]))
        given["accessors"].append({
            "bufferView": len(given["bufferViews"]) - 1, "componentType": 5121 if array.dtype == np.uint8 else 5126,
            "type": kind, "count": len(array),
        })  # fmt: skip
        content += array.tobytes()
    given["buffers"] = [{"byteLength": len(content), "uri": uri(content)}]
    return numbers


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
