"""OFF files. Source: Geomview's manual, "OFF Files"."""

from __future__ import annotations

import re

from atra.errors import InputError
from atra.files.formats.words import ranges, split_text
from atra.files.meshes.parts import MeshFile, check_rows, polygon_part
from atra.files.reading import Allowance

_SPACE = rb"(?:[ \t\f\v\r\n]|#[^\r\n]*(?=[\r\n]))*+"
_HEADER = re.compile(
    rb"(?:\xef\xbb\xbf)?" + _SPACE + rb"((?:ST)?C?N?(4?n?)OFF)?" + _SPACE
    + rb"(BINARY\b)?(\d{1,18})[ \t]+(\d{1,18})(?:[ \t]+-?\d+)?[^\r\n]*"
)  # fmt: skip
"""A word that may be missing, and counts of vertices, faces and edges; ModelNet's files have no blank between them."""


def read_off_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of a text OFF, in their order; colours, normals and texture coordinates are passed over.

    Raises InputError naming the first line that is broken, and for binary and four-dimensional files.
    """
    header = _HEADER.match(content)
    if not header:
        raise InputError("it does not begin with OFF and the numbers of vertices and faces")
    if header[2] or header[3]:
        raise InputError(f"it is {header[1].decode()}{' BINARY' * bool(header[3])}, expected three-dimensional text")
    count, face_count = int(header[4]), int(header[5])
    words = split_text(content, allowance, header.end())
    if len(words.places) < count + face_count:
        promised = f"{count:,} vertices and {face_count:,} faces"
        raise InputError(f"it promises {promised}, but has {len(words.places):,} lines of them; it seems cut short")
    vertices = words.rows(words.firsts[:count], 0, words.firsts[1 : count + 1], "is no vertex of three numbers")
    first = words.firsts[count : count + face_count]
    sizes, is_good = words.wholes(first)
    is_good &= (sizes >= 0) & (sizes < words.firsts[count + 1 : count + face_count + 1] - first)
    if is_good.all():
        check_rows(count + int(sizes.sum()), allowance)
        at = ranges(first + 1, sizes)
        corners, is_good = words.wholes(at)
        first = at
    if not is_good.all():
        line = words.line(int(first[is_good.argmin()]))
        raise InputError(f"{line} is no number of corners, and as many indices")
    part, notes = polygon_part(vertices, sizes, corners)
    return MeshFile([part], notes=tuple(notes))
