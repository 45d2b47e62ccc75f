"""Mesh files of text: OBJ, OFF and STL, and the numbers of any other."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit
from atra.files.formats.words_kernels import (
    HASH,
    SLASH,
    after_blanks,
    after_word,
    is_end,
    is_letter,
    is_name,
    is_word_end,
    line_end,
    number,
    whole_number,
)

VERTICES, FACES, CORNERS, MATERIALS, OTHERS, FAULT, PLACE = range(7)
"""Places in the counts that a kernel gives back: what it found, the kind of the first fault, and its place in bytes."""

NO_NUMBER, NO_INDEX, TOO_SHORT, NO_TRIANGLE = range(1, 5)
"""Faults: no number where one is expected, no index, the end of the text before all rows, and a facet of an STL without
three vertices."""


@njit
def _fault(found, kind, place):  # type: ignore[no-untyped-def]
    found[FAULT], found[PLACE] = kind, place


@njit
def _position(text, i, row):  # type: ignore[no-untyped-def]
    """Read three numbers into `row`; the place after them, and whether they are there."""
    for axis in range(3):
        i = after_blanks(text, i)
        row[axis], i, is_number = number(text, i)
        if not is_number:
            return i, False
    return i, True


@kernel
def read_obj(text, fills, found, vertices, sizes, corners, materials):  # type: ignore[no-untyped-def]
    """Read the vertices, faces and materials of an OBJ; count them alone unless `fills`.

    vertices: (V, 3) float64. sizes: (P,) int64, corners of each face. corners: int64, vertex indices from 0 of all
    faces, one behind the other. materials: (M, 2) int64, number of faces before each `usemtl`, and the end of that
    word. OTHERS in `found`: lines and points.
    """
    i, row = 0, np.empty(3)
    found[:] = 0
    while i < len(text):
        i = start = after_blanks(text, i)
        if not is_end(text, i) and is_word_end(text, i + 1):
            if text[i] == 118:  # v
                if fills:
                    i, is_there = _position(text, i + 1, row)
                    if not is_there:
                        _fault(found, NO_NUMBER, start)
                        return
                    for axis in range(3):
                        vertices[found[VERTICES], axis] = row[axis]
                found[VERTICES] += 1
            elif text[i] == 102:  # f
                first = found[CORNERS]
                i = after_blanks(text, i + 1)
                while not is_end(text, i) and text[i] != HASH:
                    if fills:
                        index, after, is_index = whole_number(text, i)
                        is_index = is_index and index != 0 and (is_word_end(text, after) or text[after] == SLASH)
                        index += -1 if index > 0 else found[VERTICES]
                        if not is_index or index < 0 or index >= len(vertices):
                            _fault(found, NO_INDEX, i)
                            return
                        corners[found[CORNERS]] = index
                        i = after
                    found[CORNERS] += 1
                    i = after_blanks(text, after_word(text, i))
                if fills:
                    sizes[found[FACES]] = found[CORNERS] - first
                found[FACES] += 1
            elif text[i] == 108 or text[i] == 112:  # l, p
                found[OTHERS] += 1
        elif i < len(text) and text[i] == 117 and is_name(text, i, b"usemtl"):
            if fills:
                materials[found[MATERIALS], 0], materials[found[MATERIALS], 1] = found[FACES], i + 6
            found[MATERIALS] += 1
        i = line_end(text, i) + 1


@kernel
def read_off(text, start, fills, found, vertices, sizes, corners):  # type: ignore[no-untyped-def]
    """Read rows of vertices and then of faces from lines that are not empty: first numbers of each; the rest of a line,
    such as colours, is passed over. Arrays as for `read_obj`; unless `fills`, the corners are counted alone."""
    i, row = start, np.empty(3)
    found[:] = 0
    while found[FACES] < len(sizes):
        i = after_blanks(text, i)
        if i >= len(text):
            _fault(found, TOO_SHORT, i)
            return
        first = i
        if not is_end(text, i) and text[i] != HASH:
            if found[VERTICES] < len(vertices):
                i, is_there = _position(text, i, row)
                if not is_there:
                    _fault(found, NO_NUMBER, first)
                    return
                for axis in range(3):
                    vertices[found[VERTICES], axis] = row[axis]
                found[VERTICES] += 1
            else:
                count, i, is_count = whole_number(text, i)
                if not is_count or not is_word_end(text, i) or count < 0 or count > len(text):
                    _fault(found, NO_INDEX, first)
                    return
                for _ in range(count):
                    i = after_blanks(text, i)
                    index, after, is_index = whole_number(text, i)
                    if not is_index or not is_word_end(text, after):
                        _fault(found, NO_INDEX, i)
                        return
                    if fills:
                        corners[found[CORNERS]] = index
                    found[CORNERS] += 1
                    i = after
                sizes[found[FACES]] = count
                found[FACES] += 1
        i = line_end(text, i) + 1


@kernel
def read_stl(text, fills, found, vertices):  # type: ignore[no-untyped-def]
    """Read the corners (3 F, 3) float64 of a text STL; count facets and vertices alone unless `fills`.

    MATERIALS and OTHERS in `found`: solids that begin, and that end.
    """
    i, row = 0, np.empty(3)
    found[:] = 0
    while i < len(text):
        i = after_blanks(text, i)
        if is_end(text, i) or text[i] == HASH:
            i += 1
            continue
        start = i
        if is_name(text, i, b"vertex"):
            i, is_there = _position(text, i + 6, row)
            if not is_there:
                _fault(found, NO_NUMBER, start)
                return
            if fills:
                for axis in range(3):
                    vertices[found[VERTICES], axis] = row[axis]
            found[VERTICES] += 1
        elif is_name(text, i, b"facet") or is_name(text, i, b"endfacet"):
            found[FACES] += is_letter(text, i, 102)
            if found[VERTICES] != 3 * (found[FACES] - is_letter(text, i, 102)):
                _fault(found, NO_TRIANGLE, start)
                return
            i = after_word(text, i)
        elif is_name(text, i, b"solid") or is_name(text, i, b"endsolid"):
            found[MATERIALS if is_letter(text, i, 115) else OTHERS] += 1
            i = line_end(text, i)
        else:
            i = after_word(text, i)


@kernel
def read_words(text, start, fills, found, numbers):  # type: ignore[no-untyped-def]
    """Read all numbers of a text, or count them; VERTICES in `found` is how many."""
    i = start
    found[:] = 0
    while True:
        i = after_blanks(text, i)
        if i >= len(text):
            return
        if is_end(text, i):
            i += 1
            continue
        if fills:
            value, after, is_number = number(text, i)
            if not is_number:
                _fault(found, NO_NUMBER, i)
                return
            numbers[found[VERTICES]] = value
            i = after
        found[VERTICES] += 1
        while not is_end(text, i) and after_blanks(text, i) == i:
            i += 1
