"""OBJ files. Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual."""

from __future__ import annotations

import codecs
import re

import numpy as np

from atra.errors import InputError, printable
from atra.files.formats.words import code_of, ranges, split_text
from atra.files.meshes.parts import NONE, MeshFile, check_rows, polygon_part
from atra.files.reading import Allowance


def read_obj_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of an OBJ, in their order, with their materials.

    Vertices keep the numbers that they have in the file. Texture coordinates, normals, groups, lines and points are not
    read. Raises InputError naming the first line that is broken.
    """
    words = split_text(content, allowance, len(codecs.BOM_UTF8) * content.startswith(codecs.BOM_UTF8))
    firsts, ends = words.firsts[:-1], words.firsts[1:]
    kinds = words.codes[firsts]
    is_vertex, lines = kinds == code_of("v"), np.flatnonzero(kinds == code_of("f"))
    sizes = ends[lines] - firsts[lines] - 1
    check_rows(int(is_vertex.sum() + sizes.sum()), allowance)
    vertices = words.triples(firsts[is_vertex], 1, ends[is_vertex], "has no three numbers, expected a vertex")
    at = ranges(firsts[lines] + 1, sizes)
    corners, is_whole = words.wholes(at, most_code=1)
    if (corners < 0).any():  # counted back from the vertices above the face
        above = np.cumsum(is_vertex)[lines]
        corners = np.where(corners < 0, corners + np.repeat(above, sizes), corners - 1)
    else:
        corners -= 1
    is_good = is_whole & (corners >= 0) & (corners < len(vertices))
    if not is_good.all():
        word = int(at[is_good.argmin()])
        raise InputError(
            f"{words.line(word)} names vertex {words.word(word).split('/')[0]}, expected 1 to {len(vertices)}, or -1 "
            "to the number of vertices above it"
        )
    with_material, names = np.flatnonzero(kinds == code_of("usemtl")), dict[str, int]()
    numbers = [names.setdefault(_name(content, place), len(names)) for place in words.places[with_material].tolist()]
    material = np.array([*numbers, NONE], np.int32)[np.searchsorted(with_material, lines) - 1] if numbers else None
    part, notes = polygon_part(vertices, sizes, corners, material)
    others = int(((kinds == code_of("l")) | (kinds == code_of("p"))).sum())
    if others:
        notes.append(f"{others:,} lines and points are left out")
    return MeshFile([part], tuple(names), notes=tuple(notes))


def _name(content: bytes, place: int) -> str:
    """The name of a material, behind the word `usemtl` at a place."""
    line = re.compile(rb"[^\r\n#]*").match(content, place + len("usemtl"))
    assert line is not None
    return printable(line[0].decode(errors="replace").strip())
