"""The triangles of a glTF or GLB, as its nodes place them. Source: Khronos, "glTF 2.0 Specification"."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.folder import Folder
from atra.files.gltf.nodes import nodes_of, places_of
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.packed import DRACO, MESHOPT
from atra.files.gltf.poses import poses_of
from atra.files.gltf.primitives import FAN, TRIANGLES, claimed_rows, read_primitive
from atra.files.gltf.tree import entry, gltf_tree, without
from atra.files.meshes.parts import NONE, MeshFile, Part, check_rows, placed_part
from atra.files.reading import Allowance

_BYTES_PER_PART = 20_000
"""Memory for a part, more than it takes: the bound then covers the time of reading it, too."""

_BYTES_PER_NODE = 500
"""Memory for a node, however empty."""

_READ = {DRACO, *MESHOPT, "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"}
_NOT_GEOMETRY = re.compile(r"[A-Z]+_(?:materials?|textures?|lights?)_\w+")
"""Extensions that a file may require."""


def read_gltf_file(path: Path, content: bytes, suffix: str, memory_per_byte: float | None) -> MeshFile:
    """The triangles of the default scene: nodes depth first in their order, primitives in theirs.

    Vertices are in world space; a transform that mirrors turns the winding of its faces. Raises InputError for required
    extensions that are not read, and for nodes with several parents.
    """
    tree, folder = gltf_tree(content, suffix), Folder(path)
    for name in tree.get("extensionsRequired", []):
        if name not in _READ and not _NOT_GEOMETRY.fullmatch(name):
            raise InputError(f"it requires the extension {name!r:.60}, which is not read; {without(name)}")
    uris = {uri for buffer in tree.get("buffers", []) if not (uri := buffer.get("uri", "data:")).startswith("data:")}
    beside = {folder.path_of(uri): folder.size_of(uri) for uri in uris}
    allowance = Allowance(len(content) + sum(beside.values()), memory_per_byte)
    nodes = tree.get("nodes", [])
    allowance.check(f"{len(nodes):,} nodes", len(nodes) * _BYTES_PER_NODE)
    notes = dict.fromkeys(["animations are left out"] if tree.get("animations") else [])
    parts = _parts(tree, Numbers(tree, content, suffix, folder), allowance, notes)
    return MeshFile(parts, _names(tree.get("materials", [])), _names(nodes), "meter", tuple(notes))


def _parts(tree: Any, numbers: Numbers, allowance: Allowance, notes: dict[str, None]) -> list[Part]:
    made: dict[tuple[int, int, int], tuple[NDArray[np.float64], NDArray[np.int64]]] = {}
    poses = poses_of(tree, numbers)
    parts: list[Part] = []
    count = rows = 0
    for node in nodes_of(tree):
        if "mesh" not in node.given:
            continue
        mesh = node.given["mesh"]
        primitives = entry(tree, "meshes", mesh)["primitives"]
        pose = poses[node.number]
        own = NONE if pose.is_plain else node.number
        for place in places_of(node, numbers, allowance) if pose.joints is None else [np.eye(4)]:
            for k, primitive in enumerate(primitives):
                mode = primitive.get("mode", TRIANGLES)
                if mode not in range(FAN + 1):
                    raise InputError(f"a primitive has the mode {mode!r:.50}, expected 0 to {FAN}")
                if mode < TRIANGLES:
                    notes["points and lines are left out"] = None
                    continue
                count, rows = count + 1, rows + claimed_rows(primitive, numbers)
                allowance.check(f"{count:,} parts and more", count * _BYTES_PER_PART)
                check_rows(rows, allowance)
                if (mesh, k, own) not in made:
                    made[mesh, k, own] = read_primitive(tree, primitive, numbers, pose)
                vertices, faces = made[mesh, k, own]
                material = primitive.get("material", NONE)
                parts.append(placed_part(vertices, faces, place, material, node.number))
    return [part for part in parts if len(part.faces)]


def _names(things: Any) -> tuple[str, ...]:
    return tuple(printable(str(one.get("name", number))) for number, one in enumerate(things))
