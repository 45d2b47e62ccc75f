"""What a glTF with its light puts right that its file has against the rules, and instances of one mesh."""

import json
import warnings
from base64 import b64encode

import numpy as np
import pytest

from atra import light
from atra.light import save_model
from tests.light.lightmaps.test_lit_model import baked, source, tree_of

__all__ = ["source"]


def test_what_a_file_has_against_the_rules_of_glb_is_put_right(source, tmp_path):
    """Rows of animations one after the other need no stride, and images lie inside."""
    tree = tree_of(source)
    binary = source.read_bytes()[-tree["buffers"][0]["byteLength"] :]
    times = np.float32([0.0, 1.0]).tobytes()
    buffer = binary + times + np.float32([[0, 0, 0], [0, 1, 0]]).tobytes()
    tree["buffers"] = [{"byteLength": len(buffer), "uri": data_uri("application/octet-stream", buffer)}]
    for start, size, kind in ((len(binary), 4, "SCALAR"), (len(binary) + 8, 12, "VEC3")):
        tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": 2 * size, "byteStride": size})
        view = len(tree["bufferViews"]) - 1
        tree["accessors"].append({"bufferView": view, "componentType": 5126, "count": 2, "type": kind})
    number = len(tree["accessors"])
    target = {"node": next(k for k, node in enumerate(tree["nodes"]) if "mesh" in node), "path": "translation"}
    tree["animations"] = [
        {"samplers": [{"input": number - 2, "output": number - 1}], "channels": [{"sampler": 0, "target": target}]}
    ]
    for image in tree["images"]:
        view = tree["bufferViews"][image.pop("bufferView")]
        image["uri"] = data_uri(image.pop("mimeType"), binary[view["byteOffset"] :][: view["byteLength"]])
    path = tmp_path / "other.gltf"
    path.write_text(json.dumps(tree))
    with pytest.warns(UserWarning, match="not used: animations"):
        baked(path, tmp_path / "lit.glb", samples=1, size=64)
    after = tree_of(tmp_path / "lit.glb")
    (sampler,) = after["animations"][0]["samplers"]
    for key in ("input", "output"):
        assert "byteStride" not in after["bufferViews"][after["accessors"][sampler[key]]["bufferView"]]
    assert all("bufferView" in one and "uri" not in one for one in after["images"])
    assert {one["mimeType"] for one in after["images"]} == {"image/png"}


def test_instances_have_nodes_and_light_of_their_own(source, tmp_path):
    tree = tree_of(source)
    binary = source.read_bytes()[-tree["buffers"][0]["byteLength"] :]
    rows = np.float32([[0, 0, 0], [0, 0, 1.2]]).tobytes() + np.float32([[0, 0, 0, 1], [0, 2, 0, 2]]).tobytes()
    buffer = binary + rows
    tree["buffers"] = [{"byteLength": len(buffer), "uri": data_uri("application/octet-stream", buffer)}]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(rows)})
    of_view = {"bufferView": len(tree["bufferViews"]) - 1, "componentType": 5126, "count": 2}
    number = len(tree["accessors"])
    tree["accessors"] += [of_view | {"type": "VEC3"}, of_view | {"type": "VEC4", "byteOffset": 24}]
    left = next(node for node in tree["nodes"] if node.get("name") == "left")
    many = {"attributes": {"TRANSLATION": number, "ROTATION": number + 1}}
    left["extensions"] = {"EXT_mesh_gpu_instancing": many}
    tree["extensionsUsed"].append("EXT_mesh_gpu_instancing")
    path = tmp_path / "many.gltf"
    path.write_text(json.dumps(tree))
    scene, lightmap, _ = baked(path, tmp_path / "lit.glb", samples=1, size=64)
    assert scene.mesh.triangle_count == 48
    save_model(lightmap, scene, tmp_path / "unlit.glb", path)
    for name in ("lit.glb", "unlit.glb"):
        after = tree_of(tmp_path / name)
        assert "EXT_mesh_gpu_instancing" not in json.dumps(after)
        with warnings.catch_warnings(action="ignore"):
            read = light.load_scene(tmp_path / name)
        corners = [np.sort(one.mesh.vertices[one.mesh.faces].reshape(-1, 3), axis=0) for one in (scene, read)]
        np.testing.assert_allclose(*corners, atol=1e-5)
        meshes = [node["mesh"] for node in after["nodes"] if "mesh" in node]
        assert len(set(meshes)) == len(meshes) == 4


def data_uri(kind, content):
    return f"data:{kind};base64,{b64encode(content).decode()}"
