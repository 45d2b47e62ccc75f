"""PLY files, binary and text. Source: Greg Turk, "The PLY Polygon File Format"."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.formats.ply_kernels import FLOAT, SIGNED, UNSIGNED, read_binary_rows, read_text_rows
from atra.files.formats.text_kernels import FAULT, PLACE, VERTICES, read_words
from atra.files.meshes.parts import MeshFile, check_rows, line_of, polygon_part
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


def read_ply_file(content: bytes, allowance: Allowance) -> MeshFile:
    """The faces of a PLY, in their order. Raises InputError for a file that promises more than it holds."""
    order, elements, at = _header(content)
    numbers = _numbers(content, at, allowance) if order == "" else None
    at = 0 if order == "" else at
    vertices: NDArray[np.floating] = np.empty((0, 3))
    faces = None
    notes = []
    for element in elements:
        if element.name == "vertex" and not any(one.length for one in element.properties):
            vertices, at = _vertices(content, numbers, at, element, order, allowance)
        elif element.name in ("face", "tristrips") and element.rows and element.properties:
            if faces is not None:
                raise InputError("it has faces beside tristrips, expected one of both; export faces alone")
            faces, at = _faces(content, numbers, at, element, order, allowance)
            if element.name == "tristrips":
                faces = _of_strips(*faces, allowance)
        else:
            _, _, at = _rows(content, numbers, at, element, order, None, allowance)
            if element.name not in ("vertex", "face") and element.rows:
                notes.append(f"{element.rows:,} rows of the element {element.name} are left out")
    if numbers is not None and at < len(numbers):
        raise InputError(f"its rows hold {len(numbers) - at:,} numbers more than its header says")
    if numbers is None and at < len(content):
        notes.append(f"{len(content) - at:,} bytes after the last row are left out")
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


def _numbers(content: bytes, at: int, allowance: Allowance) -> NDArray[np.float64]:
    """All numbers after the header of a text."""
    text, found = np.frombuffer(content, np.uint8), np.zeros(PLACE + 1, np.int64)
    numbers = np.empty(0)
    for fills in (False, True):
        read_words(text, at, fills, found, numbers)
        if found[FAULT]:
            raise InputError(f"{line_of(content, int(found[PLACE]))} holds what is no number")
        if not fills:
            allowance.check(f"{found[VERTICES]:,} numbers", 8 * int(found[VERTICES]))
            numbers = np.empty(found[VERTICES])
    return numbers


def _check(element: Element, least: int, left: int, allowance: Allowance) -> None:
    """Check that rows of at least so many bytes or numbers each fit what is left."""
    if element.rows * max(least, 1) > left:
        raise InputError(
            f"it promises {element.rows:,} rows of the element {element.name}, but ends before; it seems cut short"
        )
    check_rows(element.rows, allowance)


def _vertices(
    content: bytes, numbers: NDArray[np.float64] | None, at: int, element: Element, order: str, allowance: Allowance
) -> tuple[NDArray[np.floating], int]:
    """(V, 3) float64, or float32 where the file has that, and the place behind them."""
    names = [one.name for one in element.properties]
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"its vertices have {', '.join(names) or 'nothing'}, expected x, y and z")
    columns = [names.index(axis) for axis in "xyz"]
    if numbers is not None:
        width = len(names)
        _check(element, width, len(numbers) - at, allowance)
        end = at + element.rows * width
        return numbers[at:end].reshape(-1, width)[:, columns], end
    kind = np.dtype([(str(k), order + one.values) for k, one in enumerate(element.properties)])
    _check(element, kind.itemsize, len(content) - at, allowance)
    rows = np.frombuffer(content, kind, element.rows, at)
    is_single = all(element.properties[column].values == "f4" for column in columns)
    vertices = np.empty((element.rows, 3), np.float32 if is_single else np.float64)
    for axis, column in enumerate(columns):
        vertices[:, axis] = rows[str(column)]
    return vertices, at + element.rows * kind.itemsize


def _faces(
    content: bytes, numbers: NDArray[np.float64] | None, at: int, element: Element, order: str, allowance: Allowance
) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], int]:
    """Number of corners (P,) and the corners of the faces, and the place behind them."""
    lists = [k for k, one in enumerate(element.properties) if one.length]
    named = [k for k in lists if element.properties[k].name in _FACES]
    if not lists:
        raise InputError("its faces have no list of vertices")
    wanted = (named or lists)[0]
    if element.properties[wanted].values[0] == "f":
        raise InputError("its faces name vertices by numbers that are not whole")
    found = None if numbers is not None else _alike(content, at, element, order, wanted, allowance)
    if found is not None:
        return found
    sizes, corners, end = _rows(content, numbers, at, element, order, wanted, allowance)
    return (sizes, corners), end


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
    return np.full(len(triangles), 3), triangles.ravel()


def _alike(
    content: bytes, at: int, element: Element, order: str, wanted: int, allowance: Allowance
) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], int] | None:
    """As `_faces` where each list is as long as in the first row, read as fast as bytes; None where they are not."""
    place, fields = at, list[Any]()
    lengths = {}
    for k, one in enumerate(element.properties):
        count = 1
        if one.length:
            kind = np.dtype(order + one.length)
            if kind.kind == "f" or place + kind.itemsize > len(content):
                return None
            count = lengths[k] = int(np.frombuffer(content, kind, 1, place)[0])
            fields.append((f"length {k}", kind))
            place += kind.itemsize
        kind = np.dtype(order + one.values)
        if count < 0 or place + count * kind.itemsize > len(content):
            return None
        fields.append((f"values {k}", kind, (count,)))
        place += count * kind.itemsize
    row = np.dtype(fields)
    if element.rows * row.itemsize > len(content) - at:
        return None
    rows = np.frombuffer(content, row, element.rows, at)
    if any((rows[f"length {k}"] != length).any() for k, length in lengths.items()):
        return None
    check_rows(element.rows * max(1, lengths[wanted]), allowance)
    sizes = np.broadcast_to(np.int64(lengths[wanted]), element.rows)
    # Triangles keep the file's type of numbers; kernels that cut other polygons take int64.
    corners = rows[f"values {wanted}"]
    kind = corners.dtype.newbyteorder("=") if lengths[wanted] == 3 else np.dtype(np.int64)
    return (sizes, corners.astype(kind).ravel()), at + element.rows * row.itemsize


def _rows(
    content: bytes,
    numbers: NDArray[np.float64] | None,
    at: int,
    element: Element,
    order: str,
    wanted: int | None,
    allowance: Allowance,
) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """Lengths and values of the wanted list of each row, one behind the other, and the place behind the rows."""
    least = [np.dtype(one.length or one.values).itemsize if numbers is None else 1 for one in element.properties]
    if not least:
        return np.empty(0, np.int64), np.empty(0, np.int64), at
    _check(element, sum(least), (len(content) if numbers is None else len(numbers)) - at, allowance)
    table = np.array([_code(one.length) + _code(one.values) for one in element.properties], np.int64)
    place = -1 if wanted is None else wanted
    sizes, corners = np.zeros(element.rows, np.int64), np.empty(0, np.int64)
    for fills in (False, True) if wanted is not None else (False,):
        if numbers is None:
            text = np.frombuffer(content, np.uint8)
            end, total, row = read_binary_rows(text, at, table, order == ">", place, sizes, corners, fills)
        else:
            end, total, row = read_text_rows(numbers, at, table, place, sizes, corners, fills)
        if end < 0:
            raise InputError(
                f"it promises {element.rows:,} rows of the element {element.name}, but row {row} is broken or missing; "
                "it seems cut short"
            )
        if not fills:
            check_rows(element.rows + int(total), allowance)
            corners = np.empty(total, np.int64)
    return sizes, corners, end


def _code(name: str | None) -> tuple[int, int]:
    """Bytes and kind of a type; no bytes for None."""
    return (0, 0) if name is None else (np.dtype(name).itemsize, _KINDS[name[0]])
