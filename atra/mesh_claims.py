"""What the bytes of a mesh file claim, checked before a reader believes them.

The readers of `trimesh` ask for the memory a header names and give zeros for geometry that is stored in a way they do
not know; both are found here, from the bytes alone.
"""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

from atra.errors import InputError

_PLY_FACES = re.compile(rb"(?m)^element\s+face\s+(\d{1,18})\b")
_OFF_COUNTS = re.compile(rb"C?OFF\s+\d+\s+(\d{1,18})\b")
_OBJ_FACE = re.compile(rb"(?m)^[ \t]*f[ \t]")
_STL_FACET = re.compile(rb"(?im)^[ \t]*facet\b")
_STL_HEADER_BYTES, _STL_FACET_BYTES = 84, 50

# Extensions a file may require although we know nothing of them: they say nothing of where triangles are.
_GLTF_NOT_GEOMETRY = re.compile(r"[A-Z]+_(?:materials?|textures?|lights?)_\w+")
_GLB_MAGIC, _GLB_JSON = b"glTF", b"JSON"


def check_claims(content: bytes, suffix: str) -> int:
    """How many faces a mesh file of that format must at least yield, by its own words; 0 where it does not say.

    Raises InputError, or whatever Python does with a file built differently, for a glTF or GLB with geometry that
    trimesh would read as zeros, or that would take more memory than its bytes account for.
    """
    if suffix == "ply":
        return _first_count(_PLY_FACES, content.partition(b"end_header")[0])
    if suffix == "off":
        return _first_count(_OFF_COUNTS, re.sub(rb"#[^\r\n]*", b"", content))
    if suffix == "obj":
        return sum(1 for _ in _OBJ_FACE.finditer(content))
    if suffix in ("stl", "stl_ascii"):
        count = int(np.frombuffer(content[80:_STL_HEADER_BYTES].ljust(4, b"\0"), "<u4")[0])
        if len(content) == _STL_HEADER_BYTES + count * _STL_FACET_BYTES:
            return count
        return sum(1 for _ in _STL_FACET.finditer(content))
    if suffix in ("gltf", "glb"):
        _check_gltf(json.loads(_glb_json(content) if suffix == "glb" else content.decode()))
    return 0


def _first_count(pattern: re.Pattern[bytes], content: bytes) -> int:
    found = pattern.search(content)
    return int(found.group(1)) if found else 0


def _glb_json(content: bytes) -> bytes:
    """The JSON chunk. Every chunk's length is checked, since a reader asks for as much memory before it reads."""
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
    return first


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
            for number in (primitive["attributes"].get("POSITION"), primitive.get("indices")):
                accessor = {"bufferView": None} if number is None else accessors[number]
                if "bufferView" not in accessor or "sparse" in accessor or accessor.get("normalized"):
                    raise InputError(
                        f"accessor {number} is compressed, sparse or normalized; export it as plain values"
                    )
