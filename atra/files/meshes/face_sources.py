"""Face sources: the face, material and node in a mesh file that each triangle comes from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.meshes.claims import GLTF_TRIANGLES, gltf_tree
from atra.files.meshes.loading import Part, read_parts
from atra.files.reading import read_regular_file

_OBJ_LINE = re.compile(rb"(?m)^[ \t]*(f|usemtl)\b[ \t]*([^\r\n#]*)")
_NONE = -1


@dataclass(frozen=True, eq=False)
class FaceSources:
    """The places of a mesh's triangles in its file; row i is the triangle with `prim_id` i.

    face: (F,) uint32, number of the face in the file, from 0; in a glTF, of the triangle in its primitive.
    material: (F,) int32, index into `materials`, -1 = none.
    node: (F,) int32, index into `nodes`, -1 = none.
    materials: names in the order of the file, of OBJ and glTF; in a glTF a number stands for a missing name.
    nodes: names in the order of the file, of glTF; as for `materials`.
    """

    face: NDArray[np.uint32]
    material: NDArray[np.int32]
    node: NDArray[np.int32]
    materials: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()


def load_face_sources(path: str | Path, *, memory_per_byte: float | None = None) -> FaceSources:
    """The face, material and node that each triangle of `load_mesh(path)` comes from: PLY, OBJ, OFF, STL, glTF.

    memory_per_byte: as for `load_mesh`. Raises InputError as `load_mesh`, and for other formats.
    """
    path = Path(path).expanduser()
    parts = read_parts(path, memory_per_byte)
    try:
        return _sources(read_regular_file(path), path.suffix.lower().lstrip("."), parts)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _sources(content: bytes, suffix: str, parts: Sequence[Part]) -> FaceSources:
    if suffix in ("gltf", "glb"):
        return _of_gltf(gltf_tree(content, suffix), parts)
    count = sum(len(part.faces) for part in parts)
    material: NDArray[np.int32] = np.full(count, _NONE, np.int32)
    materials: tuple[str, ...] = ()
    if suffix == "ply":
        face = _triangles_by_size(_ply_corners(parts[0].raw), count)
    elif suffix == "off":
        face = _triangles_by_size(_off_corners(content), count)
    elif suffix == "obj":
        face, material, materials = _of_obj(content, count)
    elif suffix in ("stl", "stl_ascii"):
        face = np.arange(count)
    else:
        raise InputError(f"its format {suffix!r} has no face sources, expected PLY, OBJ, OFF, STL or glTF")
    return FaceSources(face.astype(np.uint32), material, np.full(count, _NONE, np.int32), materials)


def _check_triangles(corners: NDArray[np.integer], count: int) -> None:
    """Raise InputError unless polygons with these numbers of corners make `count` triangles."""
    triangles = int(np.maximum(corners - 2, 0).sum())
    if triangles != count:
        raise InputError(
            f"its faces make {triangles:,} triangles by their lines, but {count:,} were read; export it anew"
        )


def _triangles_by_size(corners: NDArray[np.integer], count: int) -> NDArray[np.integer]:
    """The polygon of each triangle in trimesh's order: triangles, first and then second halves of quads, fans."""
    _check_triangles(corners, count)
    triangles, quads, others = (np.flatnonzero(kind) for kind in (corners == 3, corners == 4, corners > 4))
    return np.concatenate([triangles, quads, quads, np.repeat(others, corners[others] - 2)])


def _ply_corners(elements: Any) -> NDArray[np.integer]:
    data = elements["face"]["data"]
    names = data.dtype.names if isinstance(data, np.ndarray) else tuple(data)
    name = next((one for one in ("vertex_index", "vertex_indices") if one in names), names[0])
    lists = data[name]["f1"] if isinstance(data, np.ndarray) else data[name]
    return np.array([len(one) for one in lists]) if len(lists) else np.empty(0, int)


def _off_corners(content: bytes) -> NDArray[np.integer]:
    lines = [words for line in re.sub(rb"#[^\r\n]*", b"", content).splitlines() if (words := line.split())]
    counts = lines[1] if len(lines[0]) == 1 else lines[0][1:]
    first = (2 if len(lines[0]) == 1 else 1) + int(counts[0])
    return np.array([int(words[0]) for words in lines[first : first + int(counts[1])]])


def _of_obj(content: bytes, count: int) -> tuple[NDArray[np.integer], NDArray[np.int32], tuple[str, ...]]:
    """Face and material of each triangle, and the materials' names."""
    content = content.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    names: dict[str, int] = {}
    current, corners, columns = _NONE, list[int](), set[int]()
    material: list[int] = []
    for keyword, rest in _OBJ_LINE.findall(content):
        if keyword == b"usemtl":
            current = names.setdefault(printable(rest.decode(errors="replace").strip()), len(names))
        else:
            material.append(current)
            corners.append(len(rest.split()))
            columns.add(len(rest.replace(b"/", b" ").split()))
    of_face = np.array(corners)
    if len(columns) == 1:  # trimesh reads faces that are all alike at once, others line by line
        face = _triangles_by_size(of_face, count)
    else:
        _check_triangles(of_face, count)
        face = np.repeat(np.arange(len(of_face)), np.maximum(of_face - 2, 0))
    return face, np.array(material, np.int32)[face], tuple(names)


def _of_gltf(tree: Any, parts: Sequence[Part]) -> FaceSources:
    """Undo `geometry_of`, which makes a node of each primitive of a mesh with several, behind all other nodes."""
    nodes = tree.get("nodes", [])
    own: list[list[Any]] = []
    for node in nodes:
        primitives = tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []
        own.append([one.get("material") for one in primitives if one.get("mode", 4) in GLTF_TRIANGLES])
    origin = [(number, of_node[0] if len(of_node) == 1 else None) for number, of_node in enumerate(own)]
    origin += [(number, one) for number, of_node in enumerate(own) if len(of_node) != 1 for one in of_node]
    found = [origin[int(part.node)] for part in parts]
    counts = [len(part.faces) for part in parts]
    return FaceSources(
        np.concatenate([np.arange(count, dtype=np.uint32) for count in counts]),
        np.repeat(np.array([_NONE if material is None else material for _, material in found], np.int32), counts),
        np.repeat(np.array([node for node, _ in found], np.int32), counts),
        _names(tree.get("materials", [])),
        _names(nodes),
    )


def _names(things: Iterable[Any]) -> tuple[str, ...]:
    return tuple(printable(str(one.get("name", number))) for number, one in enumerate(things))
