"""PLY files, binary and text. Source: Greg Turk, "The PLY Polygon File Format"."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.ply_kernels import walk_rows
from atra.files.formats.words import split_text
from atra.files.meshes.parts import MeshFile, check_rows, polygon_part
from atra.files.reading import Allowance

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_LENGTHS = {name for name, code in _TYPES.items() if code[0] != "f"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACES = ("vertex_indices", "vertex_index")

_MOST_HEADER_BYTES = 1 << 20
"""Upper limit of a header's size, which has a few hundred bytes."""


class _Property(NamedTuple):
    """name, type of the values, and type of a list's length, None for a single value."""

    name: str
    values: np.dtype[Any]
    length: np.dtype[Any] | None


class _Element(NamedTuple):
    """name, number of rows, and properties of a row."""

    name: str
    rows: int
    properties: list[_Property]


_Polygons = tuple[NDArray[np.int64], NDArray[Any]]
"""Number of corners (P,) of polygons, and the corners of all."""


def read_ply_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of a PLY, in their order. Raises InputError for a file that promises more than it holds."""
    order, elements, at = _header(content)
    rows = _Rows(content, order, at, allowance)
    vertices: NDArray[np.floating] = np.empty((0, 3))
    faces: _Polygons | None = None
    notes = []
    for element in elements:
        if element.name == "vertex" and not any(one.length for one in element.properties):
            vertices = rows.vertices(element)
        elif element.name in ("face", "tristrips") and element.rows and element.properties:
            if faces is not None:
                raise InputError("it has faces beside tristrips, expected one of both; export faces alone")
            faces = rows.polygons(element)
            if element.name == "tristrips":
                faces = _of_strips(*faces, allowance)
        else:
            if element.properties:
                rows.lists(element, -1)
            if element.name not in ("vertex", "face") and element.rows:
                notes.append(f"{element.rows:,} rows of the element {element.name} are left out")
    left = len(rows.floats) - rows.at
    if left and order == "":
        raise InputError(f"its rows hold {left // 8:,} numbers more than its header says")
    if left:
        notes.append(f"{left:,} bytes after the last row are left out")
    if faces is None:
        return MeshFile([])
    part, more = polygon_part(vertices, *faces)
    return MeshFile([part], notes=tuple(notes + more))


def _header(content: bytes) -> tuple[str, list[_Element], int]:
    """NumPy's sign of the order of bytes, "" for text; the elements; and the place behind the header.

    The numbers of a text are of eight bytes each, floats for vertices and else whole numbers.
    """
    order, elements, at = None, list[_Element](), 0
    while at < min(len(content), _MOST_HEADER_BYTES):
        end = min((place for sign in b"\r\n" if (place := content.find(sign, at)) >= 0), default=len(content))
        words, first = content[at:end].decode(errors="replace").split(), at == 0
        at = end + (2 if content[end : end + 2] == b"\r\n" else 1)
        if first and words != ["ply"]:
            raise InputError("it does not begin with the line 'ply'")
        match words:
            case ["end_header"]:
                if order is None:
                    raise InputError("its header names no format")
                return order, elements, at
            case ["format", kind, _] if kind in _ORDERS and not elements:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(_Element(name, int(count), []))
            case ["property", *lengths, values, name] if elements and values in _TYPES and _are_lengths(lengths):
                kinds = [_TYPES[one] for one in (values, *lengths[1:])]
                if order == "":
                    kinds = ["f8" if elements[-1].name == "vertex" else "i8"] * len(kinds)
                own, *of_length = (np.dtype((order or "<") + kind) for kind in kinds)
                elements[-1].properties.append(_Property(name, own, of_length[0] if of_length else None))
            case [] | ["ply"] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise InputError(f"its header has the line {' '.join(words)!r:.100}, which is not read")
    raise InputError("its header has no end; it seems cut short")


def _are_lengths(words: list[str]) -> bool:
    """Whether words before a property's type say that it is a list, and of which type its length is; or are none."""
    return not words or (words[0] == "list" and len(words) == 2 and words[1] in _LENGTHS)


class _Rows:
    """The rows of all elements, read one element after another. at: the place of the next one.

    floats: bytes that hold the rows, read as floats. wholes: the same, read as whole numbers: of a binary PLY the file,
    of a text all its numbers, of eight bytes each; those that are not whole are -1 among the whole ones.
    """

    def __init__(self, content: bytes, order: str, at: int, allowance: Allowance) -> None:
        self.is_big_endian, self.allowance, self.at = order == ">", allowance, at
        self.floats = self.wholes = np.frombuffer(content, np.uint8)
        if order == "":
            words = split_text(content, allowance, at)
            whole, is_whole = words.wholes(slice(None))
            if words.codes.any():
                raise InputError(f"{words.line(int((words.codes != 0).argmax()))} holds what is no number")
            whole[~is_whole] = -1
            self.floats, self.wholes, self.at = words.values.view(np.uint8), whole.view(np.uint8), 0
            self.wholes.setflags(write=False)  # as the bytes of a file, for which the kernel is compiled

    def _check(self, element: _Element) -> int:
        """Check that an element's rows fit what is left, however short their lists; returns the bytes of such a row."""
        least = sum((one.length or one.values).itemsize for one in element.properties)
        if element.rows * least > len(self.floats) - self.at:
            raise InputError(
                f"it promises {element.rows:,} rows of the element {element.name}, but ends before; it seems cut short"
            )
        check_rows(element.rows, self.allowance)
        return least

    def vertices(self, element: _Element) -> NDArray[np.floating]:
        """(V, 3) float64, or float32 where the file has that."""
        names = [one.name for one in element.properties]
        if not {"x", "y", "z"} <= set(names):
            raise InputError(f"its vertices have {', '.join(names) or 'nothing'}, expected x, y and z")
        step = self._check(element)
        row = np.dtype([(str(k), one.values) for k, one in enumerate(element.properties)])
        found = np.ndarray(element.rows, row, self.floats, self.at)
        columns = [found[str(names.index(axis))] for axis in "xyz"]
        is_single = all(one.dtype.str[1:] == "f4" for one in columns)
        vertices = np.empty((element.rows, 3), np.float32 if is_single else np.float64)
        for axis, column in enumerate(columns):
            vertices[:, axis] = column
        self.at += element.rows * step
        return vertices

    def polygons(self, element: _Element) -> _Polygons:
        """The list of vertices of each row; read as fast as bytes where all lists are as long as the first."""
        lists = [k for k, one in enumerate(element.properties) if one.length]
        if not lists:
            raise InputError("its faces have no list of vertices")
        wanted = next((k for k in lists if element.properties[k].name in _FACES), lists[0])
        _, values, length = element.properties[wanted]
        if values.kind == "f":
            raise InputError("its faces name vertices by numbers that are not whole")
        least = self._check(element)
        assert length is not None
        first = self.at + sum(one.values.itemsize for one in element.properties[:wanted])
        count = int(np.ndarray(1, length, self.wholes, first)[0]) if len(lists) == 1 else -1
        step = least + count * values.itemsize
        is_alike = count >= 0 and element.rows * step <= len(self.wholes) - self.at
        if not is_alike or (np.ndarray(element.rows, length, self.wholes, first, (step,)) != count).any():
            return self.lists(element, wanted)
        check_rows(element.rows * max(1, count), self.allowance)
        place, steps = first + length.itemsize, (step, values.itemsize)
        corners = np.ndarray((element.rows, count), values, self.wholes, place, steps)
        # Triangles keep the file's type of numbers; other polygons are cut as int64.
        corners = corners.astype(values.newbyteorder("=") if count == 3 else np.int64)
        self.at += element.rows * step
        return np.broadcast_to(np.int64(count), element.rows), corners.ravel()

    def lists(self, element: _Element, wanted: int) -> _Polygons:
        """Lengths and values of the wanted list of each row, one behind the other; wanted: -1 for none."""
        self._check(element)
        lengths = [one.length or np.dtype("V0") for one in element.properties]
        kinds = zip(lengths, (one.values for one in element.properties), strict=True)
        table = np.array([(length.itemsize, length.kind == "i", of.itemsize) for length, of in kinds], np.int64)
        given = self.wholes, self.at, table, self.is_big_endian, wanted
        sizes = np.empty(element.rows, np.int64)
        end, total, row = walk_rows(*given, sizes, np.empty(0, np.uint8))
        if end < 0:
            raise InputError(
                f"it promises {element.rows:,} rows of the element {element.name}, but row {row} is broken or missing; "
                "it seems cut short"
            )
        self.at = end
        if wanted < 0:
            return sizes, sizes
        check_rows(element.rows + total, self.allowance)
        kind = element.properties[wanted].values
        values = np.empty(total * kind.itemsize, np.uint8)
        walk_rows(*given, sizes, values)
        return sizes, values.view(kind).astype(np.int64)


def _of_strips(
    sizes: NDArray[np.int64], corners: NDArray[np.int64], allowance: Allowance
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The triangles of strips as faces. Each corner from the third of a strip on makes a triangle with the two before
    it, every other one in the other order; -1 begins a new strip. Triangles that name a vertex twice only turn a strip,
    and are left out."""
    check_rows(3 * len(corners), allowance)
    begins = np.zeros(len(corners) + 1, np.int64)
    begins[np.cumsum(sizes) - sizes] = np.cumsum(sizes) - sizes
    restarts = np.flatnonzero(corners == -1)
    begins[restarts], begins[restarts + 1] = restarts, restarts + 1
    within = np.arange(len(corners)) - np.maximum.accumulate(begins)[:-1]
    third = np.flatnonzero((within >= 2) & (corners != -1))
    a, b, c = corners[third - 2], corners[third - 1], corners[third]
    is_odd = within[third] % 2 == 1
    triangles = np.stack([np.where(is_odd, b, a), np.where(is_odd, a, b), c], axis=1)
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return np.broadcast_to(3, len(triangles)), triangles.ravel()
