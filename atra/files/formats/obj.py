"""OBJ files. Source: Wavefront, "Object Files (.obj)", appendix B1 of the Advanced Visualizer manual."""

from __future__ import annotations

import codecs
import re

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.formats.text_kernels import (
    CORNERS,
    FACES,
    FAULT,
    MATERIALS,
    NO_INDEX,
    OTHERS,
    PLACE,
    VERTICES,
    read_obj,
)
from atra.files.meshes.parts import NONE, MeshFile, check_rows, line_of, polygon_part
from atra.files.reading import Allowance


def read_obj_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of an OBJ, in their order, with their materials.

    Vertices keep the numbers that they have in the file. Texture coordinates, normals, groups, lines and points are not
    read. Raises InputError naming the first line that is broken.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    text, found = np.frombuffer(content, np.uint8), np.zeros(PLACE + 1, np.int64)
    read_obj(text, False, found, np.empty((0, 3)), *np.empty((2, 0), np.int64), np.empty((0, 2), np.int64))
    count = found[VERTICES]
    if not found[FAULT]:
        check_rows(int(count + found[CORNERS]), allowance)
        vertices, materials = np.empty((count, 3)), np.empty((found[MATERIALS], 2), np.int64)
        sizes, corners = np.empty(found[FACES], np.int64), np.empty(found[CORNERS], np.int64)
        read_obj(text, True, found, vertices, sizes, corners, materials)
    if found[FAULT]:
        raise InputError(_fault(content, int(found[FAULT]), int(found[PLACE]), int(count)))
    of_face, names = _materials(content, len(sizes), materials)
    part, notes = polygon_part(vertices, sizes, corners, of_face)
    if found[OTHERS]:
        notes.append(f"{found[OTHERS]:,} lines and points are left out")
    return MeshFile([part], names, notes=tuple(notes))


def _materials(
    content: bytes, faces: int, found: NDArray[np.int64]
) -> tuple[NDArray[np.int32] | None, tuple[str, ...]]:
    """The material of each face, None if the file has none, and the materials' names."""
    if not len(found):
        return None, ()
    names: dict[str, int] = {}
    numbers = []
    for _, place in found:
        end = min((at for at in (content.find(sign, place) for sign in b"\r\n#") if at >= 0), default=len(content))
        name = printable(content[place:end].decode(errors="replace").strip())
        numbers.append(names.setdefault(name, len(names)))
    of_face = np.full(faces, NONE, np.int32)
    until = np.diff(found[:, 0], append=faces)
    of_face[found[0, 0] :] = np.repeat(np.array(numbers, np.int32), until)
    return of_face, tuple(names)


def _fault(content: bytes, kind: int, place: int, count: int) -> str:
    line = line_of(content, place)
    if kind == NO_INDEX:
        index = re.split(rb"[\s/\\#]", content[place : place + 50], maxsplit=1)[0].decode(errors="replace")
        return f"{line} names vertex {index}, expected 1 to {count}, or -1 to the number of vertices above it"
    return f"{line} has no three numbers, expected a vertex"
