"""PLY files, binary and text. Source: Greg Turk, "The PLY Polygon File Format"."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.ply_kernels import FLOAT, SIGNED, UNSIGNED, read_rows
from atra.files.formats.words import split_text
from atra.files.meshes.parts import MeshFile, check_rows, polygon_part
from atra.files.reading import Allowance

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8",
}  # fmt: skip
_KINDS = {"i": SIGNED, "u": UNSIGNED, "f": FLOAT}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FACES = ("vertex_indices", "vertex_index")

_MOST_HEADER_BYTES = 1 << 20
"""Upper limit of a header's size, which has a few hundred bytes."""


class Property(NamedTuple):
    """name, NumPy's code of the values, and that of a list's length, None for a single value."""

    name: str
    values: str
    length: str | None


class Element(NamedTuple):
    """name, number of rows, and properties of a row."""

    name: str
    rows: int
    properties: list[Property]


class _Rows(NamedTuple):
    """The rows of all elements. floats: bytes that hold them, read as floats. wholes: the same, read as whole numbers:
    of a binary PLY the file, of a text its numbers, of eight bytes each."""

    floats: NDArray[np.uint8]
    wholes: NDArray[np.uint8]
    order: str
    allowance: Allowance


def read_ply_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of a PLY, in their order. Raises InputError for a file that promises more than it holds."""
    order, elements, at = _header(content)
    whole = np.frombuffer(content, np.uint8)
    rows = _Rows(whole, whole, order, allowance)
    if order == "":
        rows, at = _numbers(content, at, allowance), 0
        for one in elements:
            kind = "f8" if one.name == "vertex" else "i8"
            one.properties[:] = [Property(name, kind, length and "i8") for name, _, length in one.properties]
    vertices: NDArray[np.floating] = np.empty((0, 3))
    faces = None
    notes = []
    for element in elements:
        if element.name == "vertex" and not any(one.length for one in element.properties):
            vertices, at = _vertices(rows, at, element)
        elif element.name in ("face", "tristrips") and element.rows and element.properties:
            if faces is not None:
                raise InputError("it has faces beside tristrips, expected one of both; export faces alone")
            faces, at = _faces(rows, at, element)
            if element.name == "tristrips":
                faces = _of_strips(*faces, allowance)
        else:
            _, at = _lists(rows, at, element, None)
            if element.name not in ("vertex", "face") and element.rows:
                notes.append(f"{element.rows:,} rows of the element {element.name} are left out")
    left = len(rows.floats) - at
    if left and order == "":
        raise InputError(f"its rows hold {left // 8:,} numbers more than its header says")
    if left:
        notes.append(f"{left:,} bytes after the last row are left out")
    if faces is None:
        return MeshFile([])
    part, more = polygon_part(vertices, *faces)
    return MeshFile([part], notes=tuple(notes + more))


def _header(content: bytes) -> tuple[str, list[Element], int]:
    """NumPy's sign of the order of bytes, "" for text; the elements; and the place behind the header."""
    order, elements, at = None, list[Element](), 0
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
            case ["format", kind, _] if kind in _ORDERS:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 19:
                elements.append(Element(name, int(count), []))
            case ["property", "list", length, values, name] if elements and {length, values} <= _TYPES.keys():
                elements[-1].properties.append(Property(name, _TYPES[values], _TYPES[length]))
            case ["property", values, name] if elements and values in _TYPES:
                elements[-1].properties.append(Property(name, _TYPES[values], None))
            case [] | ["ply"] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise InputError(f"its header has the line {' '.join(words)!r:.100}, which is not read")
    raise InputError("its header has no end; it seems cut short")


def _numbers(content: bytes, at: int, allowance: Allowance) -> _Rows:
    """All numbers after the header of a text; those that are not whole are -1 among the whole ones."""
    words = split_text(content, allowance, at)
    whole, is_whole = words.wholes(slice(None))
    if words.codes.any():
        raise InputError(f"{words.line(int((words.codes != 0).argmax()))} holds what is no number")
    whole[~is_whole] = -1
    floats, wholes = words.values.astype("<f8").view(np.uint8), whole.astype("<i8").view(np.uint8)
    wholes.setflags(write=False)  # as the bytes of a file, for which the kernel is compiled
    return _Rows(floats, wholes, "<", allowance)


def _check(rows: _Rows, at: int, element: Element, least: int) -> None:
    """Check that an element's rows of at least so many bytes each fit what is left."""
    if element.rows * max(least, 1) > len(rows.floats) - at:
        raise InputError(
            f"it promises {element.rows:,} rows of the element {element.name}, but ends before; it seems cut short"
        )
    check_rows(element.rows, rows.allowance)


def _vertices(rows: _Rows, at: int, element: Element) -> tuple[NDArray[np.floating], int]:
    """(V, 3) float64, or float32 where the file has that, and the place behind them."""
    names = [one.name for one in element.properties]
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"its vertices have {', '.join(names) or 'nothing'}, expected x, y and z")
    columns = [names.index(axis) for axis in "xyz"]
    kind = np.dtype([(str(k), rows.order + one.values) for k, one in enumerate(element.properties)])
    _check(rows, at, element, kind.itemsize)
    found = np.ndarray(element.rows, kind, rows.floats, at)
    is_single = all(element.properties[column].values == "f4" for column in columns)
    vertices = np.empty((element.rows, 3), np.float32 if is_single else np.float64)
    for axis, column in enumerate(columns):
        vertices[:, axis] = found[str(column)]
    return vertices, at + element.rows * kind.itemsize


_Polygons = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Number of corners (P,) of polygons, and the corners of all."""


def _faces(rows: _Rows, at: int, element: Element) -> tuple[_Polygons, int]:
    """The faces, and the place behind them."""
    lists = [k for k, one in enumerate(element.properties) if one.length]
    if not lists:
        raise InputError("its faces have no list of vertices")
    wanted = next((k for k in lists if element.properties[k].name in _FACES), lists[0])
    if element.properties[wanted].values[0] == "f":
        raise InputError("its faces name vertices by numbers that are not whole")
    return _alike(rows, at, element, wanted) or _lists(rows, at, element, wanted)


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


def _alike(rows: _Rows, at: int, element: Element, wanted: int) -> tuple[_Polygons, int] | None:
    """As `_lists` where each list is as long as in the first row, read as fast as bytes; None where they are not."""
    place, fields, lengths = at, list[Any](), dict[int, int]()
    for k, one in enumerate(element.properties):
        count = 1
        if one.length:
            kind = np.dtype(rows.order + one.length)
            if kind.kind == "f" or place + kind.itemsize > len(rows.wholes):
                return None
            count = lengths[k] = int(np.ndarray(1, kind, rows.wholes, place)[0])
            fields.append((f"length {k}", kind))
            place += kind.itemsize
        kind = np.dtype(rows.order + one.values)
        if count < 0 or place + count * kind.itemsize > len(rows.wholes):
            return None
        fields.append((f"values {k}", kind, (count,)))
        place += count * kind.itemsize
    row = np.dtype(fields)
    if element.rows * row.itemsize > len(rows.wholes) - at:
        return None
    found = np.ndarray(element.rows, row, rows.wholes, at)
    if any((found[f"length {k}"] != length).any() for k, length in lengths.items()):
        return None
    check_rows(element.rows * max(1, lengths[wanted]), rows.allowance)
    sizes = np.broadcast_to(np.int64(lengths[wanted]), element.rows)
    # Triangles keep the file's type of numbers; other polygons are cut as int64.
    corners = found[f"values {wanted}"]
    kind = corners.dtype.newbyteorder("=") if lengths[wanted] == 3 else np.dtype(np.int64)
    return (sizes, corners.astype(kind).ravel()), at + element.rows * row.itemsize


def _lists(rows: _Rows, at: int, element: Element, wanted: int | None) -> tuple[_Polygons, int]:
    """Lengths and values of the wanted list of each row, one behind the other, and the place behind the rows."""
    corners = np.empty(0, np.int64)
    if not element.properties:
        return (corners, corners), at
    _check(rows, at, element, sum(np.dtype(one.length or one.values).itemsize for one in element.properties))
    sizes = np.zeros(element.rows, np.int64)
    table = np.array([_code(one.length) + _code(one.values) for one in element.properties], np.int64)
    for fills in (False, True) if wanted is not None else (False,):
        place = -1 if wanted is None else wanted
        end, total, row = read_rows(rows.wholes, at, table, rows.order == ">", place, sizes, corners, fills)
        if end < 0:
            raise InputError(
                f"it promises {element.rows:,} rows of the element {element.name}, but row {row} is broken or missing; "
                "it seems cut short"
            )
        if not fills:
            check_rows(element.rows + int(total), rows.allowance)
            corners = np.empty(total, np.int64)
    return (sizes, corners), end


def _code(name: str | None) -> tuple[int, int]:
    """Bytes and kind of a type; no bytes for None."""
    return (0, 0) if name is None else (np.dtype(name).itemsize, _KINDS[name[0]])
