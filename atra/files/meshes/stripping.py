"""The geometry of a mesh file; everything else is removed before trimesh reads it.

So names, materials and normals cannot be damaged, reorder faces or take time: trimesh compares every name with all
others, splits an OBJ at every material, even in comments, and drops the children of a glTF's camera.
"""

from __future__ import annotations

import json
import re
from typing import Any

from atra.errors import InputError
from atra.files.meshes.claims import GLTF_TRIANGLES, glb_chunks, is_binary_stl

_OBJ_NOT_GEOMETRY = re.compile(rb"(?m)^[ \t]*(?:mtllib|o|g|s)\b[^\r\n]*|(?:usemtl\b|#)[^\r\n]*")
_OBJ_BAD_INDEX = re.compile(rb"(?m)^[ \t]*f\b[^\n]*[ \t](-\d+|\+?0+(?![^/ \t\n]))[^\n]*")
_STL_BETWEEN_SOLIDS = re.compile(rb"(?i)endsolid[^\n]{0,200}\n\s*solid[^\n]{0,200}\n")
_STL_NORMAL = re.compile(rb"(?i)\bnormal\b[^\r\n]*")
_MOST_SOLIDS = 1000
"""Upper limit of solids whose name cannot be removed: trimesh's time grows with their square."""

_GLTF_KEPT = ("asset", "buffers", "bufferViews", "accessors", "scene", "scenes")
_GLTF_NODE = ("children", "matrix", "translation", "rotation", "scale")


def geometry_of(content: bytes, suffix: str, tree: Any) -> bytes:
    """The file with the same triangles in the same order, without names, groups, materials and normals.

    tree: the file's `gltf_tree`; `check_claims` has passed. Raises InputError, or whatever malformed content makes
    Python raise, for triangles that trimesh would misread.
    """
    if suffix == "obj":
        return _obj_geometry(_as_utf8(content))
    if suffix in ("stl", "stl_ascii") and not is_binary_stl(content):
        return _stl_geometry(_as_utf8(content))
    if suffix == "gltf":
        return json.dumps(_gltf_geometry(tree)).encode()
    if suffix == "glb":
        text, rest = json.dumps(_gltf_geometry(tree)).encode(), glb_chunks(content)[1]
        sizes = (20 + len(text) + len(rest), len(text))
        return content[:8] + b"".join(size.to_bytes(4, "little") for size in sizes) + b"JSON" + text + rest
    return content


def _as_utf8(text: bytes) -> bytes:
    """Replace what is not UTF-8: trimesh would guess another encoding and see other text than the patterns here."""
    return text.decode(errors="replace").encode()


def _obj_geometry(text: bytes) -> bytes:
    lines = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = lines.replace(b"\\\n", b" ")
    bad = _OBJ_BAD_INDEX.search(text)
    if bad:
        # Lines that a backslash continues have been joined.
        whole = [number for number, line in enumerate(lines.split(b"\n")) if not line.endswith(b"\\")]
        before = text.count(b"\n", 0, bad.start())
        number = whole[before - 1] + 2 if before else 1
        index, line = bad.group(1).decode(), bad.group().decode(errors="replace").strip()
        raise InputError(f"line {number} names vertex {index} in {line!r}, expected indices from 1; export it anew")
    return _OBJ_NOT_GEOMETRY.sub(b"", text)


def _stl_geometry(text: bytes) -> bytes:
    text = _STL_NORMAL.sub(b"", _STL_BETWEEN_SOLIDS.sub(b"", text))
    solids = text.lower().count(b"endsolid")
    if solids > _MOST_SOLIDS:
        raise InputError(f"{solids} solids end in the middle of a line, expected each `endsolid` on a line of its own")
    return text


def _gltf_geometry(tree: Any) -> Any:
    """The nodes, and each primitive with triangles as a mesh of its own; a node for each if a mesh has several.

    trimesh tells the primitives of one mesh apart by random digits, and loses one where these are equal.
    """
    parts: dict[int, list[dict[str, int]]] = {}
    meshes: list[Any] = []
    for index, mesh in enumerate(tree.get("meshes", [])):
        triangles = [primitive for primitive in mesh["primitives"] if primitive.get("mode", 4) in GLTF_TRIANGLES]
        parts[index] = [{"mesh": len(meshes) + number} for number in range(len(triangles))]
        meshes += [{"primitives": [_gltf_primitive(primitive)]} for primitive in triangles]
    nodes = [{key: node[key] for key in _GLTF_NODE if key in node} for node in tree.get("nodes", [])]
    for node, given in zip(nodes[:], tree.get("nodes", []), strict=True):
        own = parts[given["mesh"]] if "mesh" in given else []
        if len(own) == 1:
            node["mesh"] = own[0]["mesh"]
            continue
        # Reversed, since trimesh visits the last child first.
        node["children"] = [*node.get("children", []), *reversed(range(len(nodes), len(nodes) + len(own)))]
        nodes += own
    return {**{key: tree[key] for key in _GLTF_KEPT if key in tree}, "meshes": meshes, "nodes": nodes}


def _gltf_primitive(primitive: Any) -> Any:
    position = {"POSITION": primitive["attributes"]["POSITION"]}
    return {"attributes": position, **{key: primitive[key] for key in ("indices", "mode") if key in primitive}}
