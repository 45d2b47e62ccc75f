"""STL files, binary and text. Source: 3D Systems, "StereoLithography Interface Specification"."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.text_kernels import FACES, FAULT, MATERIALS, NO_NUMBER, OTHERS, PLACE, VERTICES, read_stl
from atra.files.meshes.parts import MeshFile, check_rows, line_of, polygon_part
from atra.files.reading import Allowance

_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_TEXT = re.compile(rb"\s*(?:solid|facet)\b", re.IGNORECASE)


def read_stl_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The facets of an STL, in their order; no two share a vertex. Normals are not read.

    It is binary where its length is what its header states, or where it does not begin as text; bytes after the facets
    are left out. Raises InputError for a file that seems cut short, and naming the first line that is broken.
    """
    count = int.from_bytes(content[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    size, notes = _HEADER_BYTES + count * _FACET.itemsize, []
    if len(content) != size and _TEXT.match(content) and b"\0" not in content[:1024]:
        vertices: NDArray[np.floating] = _text_vertices(content, allowance)
    else:
        if len(content) < max(size, _HEADER_BYTES):
            raise InputError(f"it promises {count:,} facets, but has only {len(content):,} bytes; it seems cut short")
        if len(content) > size:
            if count == 0:
                raise InputError(f"it promises no facets, but has {len(content):,} bytes; export it anew")
            notes.append(f"{len(content) - size:,} bytes after its {count:,} facets are left out")
        check_rows(4 * count, allowance)
        facets = np.frombuffer(content, _FACET, count, _HEADER_BYTES)
        vertices = facets["corners"].reshape(-1, 3)  # a copy: of float32, which the file has
    part, more = polygon_part(vertices, np.full(len(vertices) // 3, 3), np.arange(len(vertices)))
    return MeshFile([part], notes=tuple(notes + more))


def _text_vertices(content: bytes, allowance: Allowance) -> NDArray[np.float64]:
    """(3 F, 3) float64."""
    text, found = np.frombuffer(content, np.uint8), np.zeros(PLACE + 1, np.int64)
    vertices = np.empty((0, 3))
    for fills in (False, True):
        read_stl(text, fills, found, vertices)
        if found[FAULT]:
            kind = "no vertex of three numbers" if found[FAULT] == NO_NUMBER else "in a facet without three vertices"
            raise InputError(f"{line_of(content, int(found[PLACE]))} is {kind}")
        if found[VERTICES] != 3 * found[FACES] or found[OTHERS] < found[MATERIALS]:
            raise InputError(
                f"it has {found[VERTICES]:,} vertices in {found[FACES]:,} facets, and {found[MATERIALS]:,} solids of "
                f"which {found[OTHERS]:,} end; it seems cut short"
            )
        if not fills:
            check_rows(int(found[VERTICES] + found[FACES]), allowance)
            vertices = np.empty((found[VERTICES], 3))
    return vertices
