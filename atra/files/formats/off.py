"""OFF files. Source: Geomview's manual, "OFF Files"."""

from __future__ import annotations

import codecs
import re

import numpy as np

from atra.errors import InputError
from atra.files.formats.text_kernels import CORNERS, FAULT, NO_NUMBER, PLACE, TOO_SHORT, read_off
from atra.files.meshes.parts import MeshFile, check_rows, line_of, polygon_part
from atra.files.reading import Allowance

_SPACE = rb"(?:[ \t\f\v\r\n]|#[^\r\n]*(?=[\r\n]))*+"
_HEADER = re.compile(
    _SPACE + rb"((?:ST)?C?N?(4?n?)OFF)?" + _SPACE + rb"(BINARY\b)?(\d{1,18})[ \t]+(\d{1,18})(?:[ \t]+-?\d+)?[^\r\n]*"
)
"""A word that may be missing, and counts of vertices, faces and edges; ModelNet's files have no blank between them."""


def read_off_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of a text OFF, in their order; colours, normals and texture coordinates are passed over.

    Raises InputError naming the first line that is broken, and for binary and four-dimensional files.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    header = _HEADER.match(content)
    if not header:
        raise InputError("it does not begin with OFF and the numbers of vertices and faces")
    if header[2] or header[3]:
        raise InputError(f"it is {header[1].decode()}{' BINARY' * bool(header[3])}, expected three-dimensional text")
    vertex_count, face_count = int(header[4]), int(header[5])
    if 6 * vertex_count + 2 * face_count > len(content) + 8:
        raise InputError(
            f"it promises {vertex_count:,} vertices and {face_count:,} faces, but has only {len(content):,} bytes; it "
            "seems cut short"
        )
    check_rows(vertex_count + face_count, allowance)
    text, found = np.frombuffer(content, np.uint8), np.zeros(PLACE + 1, np.int64)
    vertices, sizes, corners = np.empty((vertex_count, 3)), np.empty(face_count, np.int64), np.empty(0, np.int64)
    for fills in (False, True):
        read_off(text, header.end(), fills, found, vertices, sizes, corners)
        if found[FAULT] == TOO_SHORT:
            raise InputError(f"it promises {face_count:,} faces, but ends before; it seems cut short")
        if found[FAULT]:
            kind = "vertex of three numbers" if found[FAULT] == NO_NUMBER else "number of corners, and as many indices"
            raise InputError(f"{line_of(content, int(found[PLACE]))} is no {kind}")
        if not fills:
            check_rows(vertex_count + int(found[CORNERS]), allowance)
            corners = np.empty(found[CORNERS], np.int64)
    part, notes = polygon_part(vertices, sizes, corners)
    return MeshFile([part], notes=tuple(notes))
