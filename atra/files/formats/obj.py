"""OBJ files. Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual."""

from __future__ import annotations

import codecs
import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.formats.words import code_of, ranges, split_text
from atra.files.formats.words_kernels import corner_rest
from atra.files.meshes.parts import NONE, MeshFile, Part, check_rows, polygon_part
from atra.files.reading import Allowance

_ROWS_PER_CORNER = 3
"""Rows of memory that a corner takes where corners are told apart by all of their numbers."""


class ObjSurface(NamedTuple):
    """The faces of an OBJ; corners that differ in position, texture coordinate or normal have vertices of their own.

    uv: (V, 2), normals and colours: (V, 3) float64, None where the file has none; NaN for a vertex without. Colours are
    sRGB, as they stand behind the coordinates. libraries: the names behind `mtllib`.
    """

    part: Part
    uv: NDArray[np.float64] | None
    normals: NDArray[np.float64] | None
    colours: NDArray[np.float64] | None
    materials: tuple[str, ...]
    libraries: tuple[str, ...]
    notes: tuple[str, ...]


def read_obj_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of an OBJ, in their order, with their materials.

    Vertices keep the numbers that they have in the file. Texture coordinates, normals, groups, lines and points are not
    read. Raises InputError naming the first line that is broken.
    """
    found = _Faces(content, allowance)
    part, notes = polygon_part(found.vertices, found.sizes, found.corners, found.material)
    return MeshFile([part], found.names, notes=(*notes, *found.notes))


def read_obj_surface(content: bytes, allowance: Allowance) -> ObjSurface:
    """As `read_obj_file`, with texture coordinates and normals. Corners without a normal are flat if others have one,
    so the vertices of such a face are its own. A texture coordinate or normal that is not in the file is noted."""
    found = _Faces(content, allowance)
    count = len(found.corners)
    check_rows(_ROWS_PER_CORNER * count, allowance)
    rest, notes = np.zeros((2, count), np.int64), list(found.notes)
    corner_rest(found.words.joined, found.words.places[found.lines], found.sizes, rest)
    keys, rows = [found.corners], []
    for numbers, word, size, told in ((rest[0], "vt", 2, "texture coordinates"), (rest[1], "vn", 3, "normals")):
        values, index, missing = found.named(word, size, numbers)
        if missing:
            notes.append(f"{missing:,} corners name {told} that the file has not")
        if word == "vn" and (index >= 0).any():
            index = np.where(index < 0, -1 - np.repeat(np.arange(len(found.sizes)), found.sizes), index)
        keys.append(index)
        rows.append(np.concatenate([values, np.full((1, size), np.nan)]))
    order = np.lexsort(keys[::-1])
    ordered = np.stack(keys)[:, order]
    is_new = np.append(np.ones(min(count, 1), np.bool_), (ordered[:, 1:] != ordered[:, :-1]).any(axis=0))
    vertex = np.empty(count, np.int64)
    vertex[order] = np.cumsum(is_new) - 1
    position, *others = ordered[:, is_new]
    part, more = polygon_part(found.vertices[position], found.sizes, vertex, found.material)
    uv, normals = (
        row[np.maximum(index, -1)] if (index >= 0).any() else None for row, index in zip(rows, others, strict=True)
    )
    libraries = tuple(dict.fromkeys(found.rest_of_lines("mtllib")))
    colours = found.colours()
    colours = None if colours is None else colours[position]
    return ObjSurface(part, uv, normals, colours, found.names, libraries, (*more, *notes))


class _Faces:
    """Vertices and faces of an OBJ, as its lines give them.

    lines: (P,) the lines of faces. sizes: (P,) their corners. corners: (C,) vertices, counted from 0. material: (P,)
    indices into `names`, or None.
    """

    def __init__(self, content: bytes, allowance: Allowance) -> None:
        self._content = content
        self.words = words = split_text(content, allowance, len(codecs.BOM_UTF8) * content.startswith(codecs.BOM_UTF8))
        self._kinds = words.codes[words.firsts[:-1]]
        self.lines = np.flatnonzero(self._kinds == code_of("f"))
        firsts = words.firsts[self.lines] + 1
        self.sizes = words.firsts[self.lines + 1] - firsts
        check_rows(int((self._kinds == code_of("v")).sum() + self.sizes.sum()), allowance)
        at = ranges(firsts, self.sizes)
        numbers, is_whole = words.wholes(at, most_code=1)
        self.vertices, self.corners, _ = self.named("v", 3, np.where(is_whole, numbers, 0))
        if (self.corners < 0).any():
            word = int(at[self.corners.argmin()])
            raise InputError(
                f"{words.line(word)} names vertex {words.word(word).split('/')[0]}, expected 1 to "
                f"{len(self.vertices)}, or -1 to the number of vertices above it"
            )
        names = dict[str, int]()
        numbered = [names.setdefault(name, len(names)) for name in self.rest_of_lines("usemtl")]
        above = np.searchsorted(np.flatnonzero(self._kinds == code_of("usemtl")), self.lines) - 1
        self.material = np.array([*numbered, NONE], np.int32)[above] if names else None
        self.names = tuple(names)
        others = int(((self._kinds == code_of("l")) | (self._kinds == code_of("p"))).sum())
        self.notes = [f"{others:,} lines and points are left out"] if others else []

    def named(
        self, word: str, size: int, numbers: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
        """The numbers (N, size) of lines that begin with a word; which of these lines each corner names, -1 = none; and
        how many corners name a line that is not there. numbers: (C,), from 1, or from -1 counted back from the face;
        0: none is named."""
        is_named, ends = self._kinds == code_of(word), self.words.firsts[1:]
        told = f"has no {'two' if size == 2 else 'three'} numbers, expected {'a vertex' if word == 'v' else word}"
        values = self.words.rows(self.words.firsts[:-1][is_named], 1, ends[is_named], told, size)
        index = numbers - 1
        if (numbers < 0).any():
            above = np.repeat(np.cumsum(is_named)[self.lines], self.sizes)
            index = np.where(numbers < 0, numbers + above, index)
        index[(index < 0) | (index >= len(values)) | (numbers == 0)] = -1
        return values, index, int(((index < 0) & (numbers != 0)).sum())

    def colours(self) -> NDArray[np.float64] | None:
        """(N, 3), the three numbers behind the coordinates of vertices; None where a vertex has none."""
        lines = np.flatnonzero(self._kinds == code_of("v"))
        firsts, ends = self.words.firsts[lines], self.words.firsts[lines + 1]
        at = firsts[:, None] + np.arange(4, 7)
        if not len(lines) or (at[:, -1] >= ends).any() or self.words.codes[at].any():
            return None
        return self.words.values[at]

    def rest_of_lines(self, word: str) -> list[str]:
        """What stands behind a word at the beginning of lines, up to a comment."""
        places = self.words.places[self._kinds == code_of(word)]
        lines = (re.compile(rb"[^\r\n#]*").match(self._content, place + len(word)) for place in places.tolist())
        return [printable(line[0].decode(errors="replace").strip()) for line in lines if line is not None]
