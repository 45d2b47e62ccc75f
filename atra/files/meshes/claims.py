"""Claims of a mesh file: sizes that its bytes state, checked before trimesh reads it.

The readers of `trimesh` allocate what a header names, may take longer than a file's size accounts for, and return zeros
for geometry in a form that they do not know. These checks find such files from their bytes alone.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.reading import Allowance, parse_json

GLTF_TRIANGLES = (4, 5)
"""Modes of a glTF primitive: triangles, and triangle strips."""

_BYTES_PER_ROW = 3 * (2 * 8 + 8 + 4)
"""Memory for the three numbers of a face or vertex: 64 bits in a part, joined and checked, 32 bits when kept."""

_BYTES_PER_PART = 20_000
"""Memory for a part of a glTF, more than it takes: the bound then covers the time of reading it, too."""

_BYTES_PER_NODE = 500
"""Memory for a node of a glTF, however empty."""

_BYTES_PER_LINE = 250
"""Memory for a line of text in an OFF or PLY, however short: trimesh makes a list or array of each."""

_MOST_PROPERTIES = 1000
"""Upper limit of a PLY's properties: trimesh's time grows with their square, and Gaussian splats have 62."""

_OFF_COUNTS = re.compile(rb"C?OFF\s+(\d{1,18})\s+(\d{1,18})\b")
_OBJ_FACE = re.compile(rb"(?m)^[ \t]*f[ \t]")
_STL_FACET = re.compile(rb"(?im)^[ \t]*facet\b")
_STL_HEADER_BYTES, _STL_FACET_BYTES = 84, 50

# Required extensions that do not concern geometry.
_GLTF_NOT_GEOMETRY = re.compile(r"[A-Z]+_(?:materials?|textures?|lights?)_\w+")
_GLTF_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_GLB_MAGIC, _GLB_JSON = b"glTF", b"JSON"


def check_claims(content: bytes, suffix: str, tree: Any, allowance: Allowance) -> int:
    """The number of faces that a mesh file states, a lower limit of what reading it must yield; 0 = none stated.

    tree: the file's `gltf_tree`. Raises InputError, or whatever malformed content makes Python raise, for a glTF or GLB
    whose geometry trimesh would misread, and for files that would take more memory than `allowance`.
    """
    if suffix == "ply":
        return _check_ply(content, allowance)
    if suffix == "off":
        return _check_off(content, allowance)
    if suffix == "obj":
        return sum(1 for _ in _OBJ_FACE.finditer(content))
    if suffix in ("stl", "stl_ascii"):
        return _stl_count(content) if is_binary_stl(content) else sum(1 for _ in _STL_FACET.finditer(content))
    if suffix in ("gltf", "glb"):
        _check_gltf(tree)
        return _check_gltf_size(tree, allowance)
    return 0


def gltf_tree(content: bytes, suffix: str) -> Any:
    """The JSON of a glTF or GLB, None for other formats. Raises InputError for text that is no JSON."""
    if suffix not in ("gltf", "glb"):
        return None
    return parse_json(glb_chunks(content)[0] if suffix == "glb" else content)


def _check_off(content: bytes, allowance: Allowance) -> int:
    found = _OFF_COUNTS.search(re.sub(rb"#[^\r\n]*", b"", content))
    vertices, faces = (int(count) for count in found.groups()) if found else (0, 0)
    _check_rows(vertices + faces, allowance)
    _check_lines(content, allowance)
    return faces


def _check_ply(content: bytes, allowance: Allowance) -> int:
    """Count header lines in the same way as trimesh, so that none is missed."""
    faces = rows = in_all = properties = values = 0
    for line in io.BytesIO(content):
        words = line.decode().split()
        if not words or "end_header" in words:
            break
        if "element" in words[0]:
            rows = abs(int(words[2]))
            in_all += rows
            faces = rows if words[1] == "face" else faces
        elif "property" in words[0]:
            properties, values = properties + 1, values + rows
    _check_rows(in_all, allowance)
    if b"ascii" in content[:100]:  # the format stands in the second line
        _check_lines(content, allowance)
    if values > len(content):
        raise InputError(f"it promises {values} values, but has only {len(content)} bytes; it seems cut short")
    if properties > _MOST_PROPERTIES:
        raise InputError(f"it has {properties} properties, expected at most {_MOST_PROPERTIES}; export it without")
    return faces


def _stl_count(content: bytes) -> int:
    return int(np.frombuffer(content[80:_STL_HEADER_BYTES].ljust(4, b"\0"), "<u4")[0])


def is_binary_stl(content: bytes) -> bool:
    """Whether the length is what the header of a binary STL states: trimesh tells binary from text by this."""
    return len(content) == _STL_HEADER_BYTES + _stl_count(content) * _STL_FACET_BYTES


def glb_chunks(content: bytes) -> tuple[bytes, bytes]:
    """The JSON chunk's text, and all chunks after it. Raises InputError for a chunk that is longer than the file."""
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
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", 4)
            if mode not in range(6):
                raise InputError(f"a primitive has the mode {mode!r}, such as a fan; export it as triangles")
            for number in (primitive["attributes"].get("POSITION"), primitive.get("indices")):
                accessor = {"bufferView": None} if number is None else accessors[number]
                if "bufferView" not in accessor or "sparse" in accessor or accessor.get("normalized"):
                    raise InputError(f"accessor {number} is compressed, sparse, normalized or empty; export it plainly")


def _check_gltf_size(tree: Any, allowance: Allowance) -> int:
    """The number of triangles in the scene. A few bytes can place a mesh, or name a buffer, a million times."""
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
            copies = max(placed[number], 1)  # meshes outside the scene are read, too
            parts, rows = parts + copies, rows + copies * (vertices + triangles)
            faces += placed[number] * triangles
    allowance.check(f"{parts:,} parts", parts * _BYTES_PER_PART)
    nodes = len(tree.get("nodes", []))
    allowance.check(f"{nodes:,} nodes", nodes * _BYTES_PER_NODE)
    views = sum(abs(view["byteLength"]) for view in tree.get("bufferViews", []))
    items = sum(accessor["count"] * 4 * _GLTF_NUMBERS[accessor["type"]] for accessor in accessors)
    _check_rows(rows, allowance, views + items)
    return faces


def _placed_meshes(tree: Any) -> Counter[int]:
    """How often the nodes of the default scene place each mesh.

    Raises InputError for a node with several parents, which the specification forbids: trimesh keeps one of its places.
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


def _check_lines(content: bytes, allowance: Allowance) -> None:
    lines = content.count(b"\n") + content.count(b"\r")
    allowance.check(f"{lines:,} lines", lines * _BYTES_PER_LINE)


def _check_rows(rows: int, allowance: Allowance, more_bytes: int = 0) -> None:
    """Check the memory of faces and vertices, and of bytes beside them."""
    beside = f" and {more_bytes:,} bytes beside them" if more_bytes else ""
    allowance.check(f"{rows:,} faces and vertices{beside}", rows * _BYTES_PER_ROW + more_bytes)
