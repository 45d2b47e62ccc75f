"""Numbers in the buffers of a glTF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder
from atra.files.gltf.packed import MESHOPT, meshopt_bytes
from atra.files.gltf.tree import entry, glb_chunks

COMPONENT_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""What the numbers of an accessor are, by its componentType."""

_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


class Numbers:
    """The accessors and buffer views of a glTF or GLB; buffers are read once, when needed. decoded: (N, size) numbers
    of accessors that are compressed."""

    def __init__(self, tree: Any, content: bytes, suffix: str, folder: Folder) -> None:
        self._tree, self._folder = tree, folder
        rest = glb_chunks(content)[1] if suffix == "glb" else memoryview(b"")
        self._chunk = rest[8 : 8 + int.from_bytes(rest[:4], "little")] if len(rest) >= 8 else None
        self._buffers: dict[int | Path, memoryview] = {}
        self._views: dict[int, memoryview] = {}
        self.decoded: dict[int, NDArray[Any]] = {}

    def view(self, number: Any) -> bytes:
        """The bytes of a buffer view."""
        return bytes(self._view(number))

    def _view(self, number: Any) -> memoryview:
        view = entry(self._tree, "bufferViews", number)
        packed = next((view["extensions"][name] for name in MESHOPT if name in view.get("extensions", {})), None)
        if packed is not None:
            if number not in self._views:
                self._views[number] = memoryview(meshopt_bytes(bytes(self._bytes(number, packed)), packed))
            return self._views[number]
        return self._bytes(number, view)

    def _bytes(self, number: int, view: Any) -> memoryview:
        buffer = self._buffer(view["buffer"])
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if not 0 <= start <= start + length <= len(buffer):
            raise InputError(f"buffer view {number} ends at byte {start + length} of {len(buffer)}")
        return buffer[start : start + length]

    def _buffer(self, number: int) -> memoryview:
        """The bytes of a buffer; a file that several name is read once."""
        uri = entry(self._tree, "buffers", number).get("uri")
        is_file = uri is not None and not (isinstance(uri, str) and uri.startswith("data:"))
        key = self._folder.path_of(uri) if is_file else number
        if key not in self._buffers:
            chunk = self._chunk if number == 0 else None
            found = chunk if uri is None else self._folder.read(uri)
            if found is None:
                raise InputError(f"buffer {number} has no bytes")
            self._buffers[key] = memoryview(found)
        return self._buffers[key]

    def floats(self, number: Any, size: int) -> NDArray[np.float64]:
        """(N, size) float64 of an accessor; normalised whole numbers become fractions."""
        accessor, rows = self.rows(number)
        if rows.shape[1] != size:
            raise InputError(f"accessor {number} has {rows.shape[1]} numbers each, expected {size}")
        found = rows.astype(np.float64)
        if accessor.get("normalized") and rows.dtype.kind in "iu":
            found = np.maximum(found / np.iinfo(rows.dtype).max, -1.0)
        return found

    def has_numbers(self, number: Any) -> bool:
        """Whether an accessor has numbers that can be read; without them it would stand for zeros."""
        return number in self.decoded or bool({"bufferView", "sparse"} & entry(self._tree, "accessors", number).keys())

    def whole(self, number: Any) -> NDArray[np.int64]:
        """(N,) int64 of an accessor of indices."""
        _, rows = self.rows(number)
        if rows.shape[1] != 1 or rows.dtype.kind != "u":
            raise InputError(f"accessor {number} is {rows.dtype} of {rows.shape[1]} each, expected indices")
        return rows[:, 0].astype(np.int64)

    def shape(self, number: Any) -> tuple[int, int]:
        """Elements of an accessor, and numbers of each, as it claims. Raises InputError for what is not read."""
        accessor = entry(self._tree, "accessors", number)
        size, count = _NUMBERS.get(accessor["type"]), accessor["count"]
        if size is None or accessor["componentType"] not in COMPONENT_TYPES:
            raise InputError(
                f"accessor {number} is {accessor['type']!r} of {accessor['componentType']!r}, which is not read"
            )
        if type(count) is not int or count < 0:
            raise InputError(f"accessor {number} has the count {count!r:.50}, expected a whole number")
        return count, size

    def rows(self, number: Any) -> tuple[Any, NDArray[Any]]:
        """An accessor, and its (N, size) numbers as they are stored."""
        (count, size), accessor = self.shape(number), entry(self._tree, "accessors", number)
        if number in self.decoded:
            return accessor, self.decoded[number]
        dtype = np.dtype(COMPONENT_TYPES[accessor["componentType"]])
        start = accessor.get("byteOffset", 0)
        if "bufferView" in accessor:
            rows = self._plain(accessor["bufferView"], start, count, size, dtype)
        else:
            rows = np.zeros((count, size), dtype)
        sparse = accessor.get("sparse")
        if sparse:
            rows, few, of_indices = rows.copy(), sparse["count"], sparse["indices"]
            kind = np.dtype(COMPONENT_TYPES[of_indices["componentType"]])
            places = self._plain(of_indices["bufferView"], of_indices.get("byteOffset", 0), few, 1, kind)[:, 0]
            if len(places) and places.max() >= count:
                raise InputError(f"accessor {number} replaces number {places.max()} of {count}")
            values = sparse["values"]
            rows[places] = self._plain(values["bufferView"], values.get("byteOffset", 0), few, size, dtype)
        return accessor, rows

    def _plain(self, view: Any, start: int, count: int, size: int, dtype: np.dtype[Any]) -> NDArray[Any]:
        content = self._view(view)
        step = entry(self._tree, "bufferViews", view).get("byteStride", size * dtype.itemsize)
        end = start + step * max(count - 1, 0) + (size * dtype.itemsize if count else 0)
        if start < 0 or step < 1 or end > len(content):
            raise InputError(f"{count} elements end at byte {end} of the {len(content)} of buffer view {view}")
        return np.ndarray((count, size), dtype, content, start, (step, dtype.itemsize))
