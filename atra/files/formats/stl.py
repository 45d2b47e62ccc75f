"""STL files, binary and text. Source: 3D Systems, "StereoLithography Interface Specification"."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.words import code_of, ranges, split_text
from atra.files.meshes.parts import MeshFile, check_rows, polygon_part
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
                raise InputError(f"it promises no facets, but has {len(content):,} bytes; export it again")
            notes.append(f"{len(content) - size:,} bytes after its {count:,} facets are left out")
        check_rows(4 * count, allowance)
        facets = np.frombuffer(content, _FACET, count, _HEADER_BYTES)
        vertices = facets["corners"].reshape(-1, 3)  # a copy: of float32, which the file has
    part, more = polygon_part(vertices, np.broadcast_to(3, len(vertices) // 3), np.arange(len(vertices)))
    return MeshFile([part], notes=tuple(notes + more))


def _text_vertices(content: bytes, allowance: Allowance) -> NDArray[np.float64]:
    """(3 F, 3) float64."""
    words = split_text(content, allowance)
    firsts, codes = words.firsts, words.codes.copy()
    is_solid = np.isin(codes[firsts[:-1]], [code_of("solid"), code_of("endsolid")])
    codes[ranges(firsts[:-1][is_solid] + 1, np.diff(firsts)[is_solid] - 1)] = 1  # names of solids
    at, begins = np.flatnonzero(codes == code_of("vertex")), codes == code_of("facet")
    check_rows(len(at) * 4 // 3, allowance)
    vertices = words.rows(at, 1, len(codes), "is no vertex of three numbers")
    facets = np.flatnonzero(begins | (codes == code_of("endfacet")))
    is_whole = np.searchsorted(at, facets) == 3 * (np.cumsum(begins[facets]) - begins[facets])
    if not is_whole.all():
        raise InputError(f"{words.line(int(facets[is_whole.argmin()]))} is in a facet without three vertices")
    solids, ends = (int((codes == code_of(word)).sum()) for word in ("solid", "endsolid"))
    if len(at) != 3 * begins.sum() or ends < solids:
        raise InputError(
            f"it has {len(at):,} vertices in {begins.sum():,} facets, and {solids:,} solids of which {ends:,} end; it "
            "seems cut short"
        )
    return vertices
