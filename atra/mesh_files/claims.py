"""Claims of a mesh file: what its bytes promise, checked before a reader believes them.

The readers of `trimesh` ask for the memory a header names, take longer than the size of a file accounts for, and give
zeros for geometry that is stored in a way they do not know; all of this is found here, from the bytes alone.
"""

from __future__ import annotations

import io
import json
import re
from collections import Counter
from typing import Any

import numpy as np
import psutil

from atra.errors import InputError

GLTF_TRIANGLES = (4, 5)
"""Modes of a primitive: triangles, and a strip of them."""

BYTES_PER_ROW = 3 * (2 * 8 + 8 + 4)
"""Three numbers of a face or a vertex: joined from parts in 64 bits, checked in 64, kept in 32."""

_MOST_PROPERTIES = 1000
"""Of a PLY: those of Gaussian splats are 62, and trimesh takes the square of it."""

_MOST_PARTS = 1_000_000
"""Of a glTF: each takes trimesh 50 microseconds."""

_OFF_COUNTS = re.compile(rb"C?OFF\s+\d+\s+(\d{1,18})\b")
_OBJ_FACE = re.compile(rb"(?m)^[ \t]*f[ \t]")
_STL_FACET = re.compile(rb"(?im)^[ \t]*facet\b")
_STL_HEADER_BYTES, _STL_FACET_BYTES = 84, 50

# Extensions a file may require although we know nothing of them: they say nothing of where triangles are.
_GLTF_NOT_GEOMETRY = re.compile(r"[A-Z]+_(?:materials?|textures?|lights?)_\w+")
_GLTF_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB_MAGIC, _GLB_JSON = b"glTF", b"JSON"


def check_claims(content: bytes, suffix: str) -> int:
    """How many faces a mesh file of that format must at least yield, by its own words; 0 where it does not say.

    Raises InputError, or whatever Python does with a file built differently, for a glTF or GLB with geometry that
    trimesh would read as zeros, leave out or put elsewhere, and for what would take more memory or time than there is
    or than the bytes account for.
    """
    if suffix == "ply":
        return _check_ply(content)
    if suffix == "off":
        return _first_count(_OFF_COUNTS, re.sub(rb"#[^\r\n]*", b"", content))
    if suffix == "obj":
        return sum(1 for _ in _OBJ_FACE.finditer(content))
    if suffix in ("stl", "stl_ascii"):
        return _stl_count(content) if is_binary_stl(content) else sum(1 for _ in _STL_FACET.finditer(content))
    if suffix in ("gltf", "glb"):
        tree = json.loads(glb_chunks(content)[0] if suffix == "glb" else content)
        _check_gltf(tree)
        return _check_gltf_size(tree)
    return 0


def _check_ply(content: bytes) -> int:
    """Properties and lines are read as trimesh reads them, so that nothing escapes the count."""
    faces = rows = properties = values = 0
    for line in io.BytesIO(content):
        words = line.decode().split()
        if not words or "end_header" in words:
            break
        if "element" in words[0]:
            rows = abs(int(words[2]))
            faces = rows if words[1] == "face" else faces
        elif "property" in words[0]:
            properties, values = properties + 1, values + rows
    if values > len(content):
        raise InputError(f"it promises {values} values, but has only {len(content)} bytes; it seems cut short")
    if properties > _MOST_PROPERTIES:
        raise InputError(f"it has {properties} properties, expected at most {_MOST_PROPERTIES}; export it without")
    return faces


def _stl_count(content: bytes) -> int:
    return int(np.frombuffer(content[80:_STL_HEADER_BYTES].ljust(4, b"\0"), "<u4")[0])


def is_binary_stl(content: bytes) -> bool:
    """Whether the length is what the header of a binary STL says, as trimesh tells it from text."""
    return len(content) == _STL_HEADER_BYTES + _stl_count(content) * _STL_FACET_BYTES


def _first_count(pattern: re.Pattern[bytes], content: bytes) -> int:
    found = pattern.search(content)
    return int(found.group(1)) if found else 0


def glb_chunks(content: bytes) -> tuple[bytes, bytes]:
    """The text of the JSON chunk, and all chunks after it.

    Every chunk's length is checked, since a reader asks for as much memory before it reads.
    """
    if content[:4] != _GLB_MAGIC:
        raise InputError(f"it starts with {content[:4]!r}, expected {_GLB_MAGIC!r}")
    start, first = 12, b""
    while start + 8 <= len(content):
        length, kind = int.from_bytes(content[start : start + 4], "little"), content[start + 4 : start + 8]
        if start + 8 + length > len(content):
            raise InputError(f"a chunk claims {length} bytes, but the file ends {len(content) - start - 8} further on")
        if start == 12 and kind == _GLB_JSON:
            first = content[20 : 20 + length]
        start += 8 + length
    return first, content[20 + len(first) :]


def _check_gltf(tree: Any) -> None:
    for name in tree.get("extensionsRequired", []):
        if not _GLTF_NOT_GEOMETRY.fullmatch(name):
            raise InputError(f"it requires the extension {name!r}, which is not read; export it without")
    accessors = tree.get("accessors", [])
    for number, accessor in enumerate(accessors):
        count = accessor["count"]
        if type(count) is not int or count < 0:
            raise InputError(f"accessor {number} has the count {count!r}, expected a whole number")
    # An accessor without bytes stands for zeros. Those of a morph target match the shape they start from.
    stored = max((accessor["count"] for accessor in accessors if "bufferView" in accessor), default=0)
    for number, accessor in enumerate(accessors):
        if accessor["count"] > stored and "bufferView" not in accessor:
            raise InputError(f"accessor {number} claims {accessor['count']} items, but names no bytes")
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode not in range(6):
                raise InputError(f"a primitive has the mode {mode!r}, such as a fan; export it as triangles")
            for number in (primitive["attributes"].get("POSITION"), primitive.get("indices")):
                accessor = {"bufferView": None} if number is None else accessors[number]
                if "bufferView" not in accessor or "sparse" in accessor or accessor.get("normalized"):
                    raise InputError(
                        f"accessor {number} is compressed, sparse or normalized; export it as plain values"
                    )


def _check_gltf_size(tree: Any) -> int:
    """How many triangles the nodes place. A few bytes can place a mesh a million times, or name one buffer as often."""
    accessors, placed = tree.get("accessors", []), _placed_meshes(tree)
    faces = rows = parts = 0
    for number, mesh in enumerate(tree.get("meshes", [])):
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode not in GLTF_TRIANGLES:
                continue
            vertices = accessors[primitive["attributes"]["POSITION"]]["count"]
            corners = accessors[primitive["indices"]]["count"] if "indices" in primitive else vertices
            triangles = corners // 3 if mode == GLTF_TRIANGLES[0] else max(corners - 2, 0)
            copies = max(placed[number], 1)  # what is not placed is read all the same
            parts, rows = parts + copies, rows + copies * (vertices + triangles)
            faces += placed[number] * triangles
    if parts > _MOST_PARTS:
        raise InputError(f"it places {parts:,} parts, expected at most {_MOST_PARTS:,}; join them before exporting")
    views = sum(abs(view["byteLength"]) for view in tree.get("bufferViews", []))
    items = sum(accessor["count"] * 4 * _GLTF_NUMBERS[accessor["type"]] for accessor in accessors)
    check_memory(rows, views + items)
    return faces


def _placed_meshes(tree: Any) -> Counter[int]:
    """How often the nodes of the scene that is shown place each mesh.

    A node has at most one parent, by the specification: trimesh goes through those with several once for each, and
    keeps the last.
    """
    nodes = tree.get("nodes", [])
    roots = tree["scenes"][tree.get("scene", 0)].get("nodes", []) if "scenes" in tree else []
    named, meshes = Counter(roots), range(len(tree.get("meshes", [])))
    for number, node in enumerate(nodes):
        named.update(node.get("children", []))
        if "mesh" in node and node["mesh"] not in meshes:
            raise InputError(f"node {number} names mesh {node['mesh']!r}, but there are {len(meshes)}")
    for number, times in named.items():
        if times > 1:
            raise InputError(f"node {number} is named by {times} parents, expected one; export the nodes as a tree")
    placed: Counter[int] = Counter()
    waiting = list(roots)
    while waiting:
        node = nodes[waiting.pop()]
        placed.update([node["mesh"]] if "mesh" in node else [])
        waiting += node.get("children", [])
    return placed


def check_memory(rows: int, more_bytes: int = 0) -> None:
    """Raise InputError if so many faces and vertices, and bytes beside them, are more than the memory that is free."""
    needed, free = rows * BYTES_PER_ROW + more_bytes, psutil.virtual_memory().available
    if needed > free:
        raise InputError(
            f"it unfolds to {rows:,} faces and vertices, which need about {needed / 2**30:.1f} GiB, but the machine "
            f"has only {free / 2**30:.1f} GiB free"
        )
