"""Triangles of a glTF's primitives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.packed import DRACO, draco_rows
from atra.files.gltf.poses import AT_REST, Pose, moved
from atra.files.meshes.parts import check_indices

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Modes of a primitive of triangles; lower ones are points and lines."""


def triangles_of_mode(mode: int, corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """(F, 3) int64 of the corners of triangles, of a strip or of a fan."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    count = max(0, len(corners) - 2)
    k = np.arange(count)
    if mode == FAN:
        return np.column_stack([corners[k + 1], corners[k + 2], np.repeat(corners[:1], count)])
    odd = k % 2
    return np.column_stack([corners[k], corners[k + 1 + odd], corners[k + 2 - odd]])


def claimed_rows(primitive: Any, numbers: Numbers) -> int:
    """Vertices and triangles of a primitive, by its accessors."""
    accessors = (primitive["attributes"]["POSITION"], primitive.get("indices"))
    counts = [numbers.shape(number)[0] for number in accessors if number is not None]
    return counts[0] + counts[-1] // (3 if primitive.get("mode", TRIANGLES) == TRIANGLES else 1)


def read_primitive(
    primitive: Any, numbers: Numbers, pose: Pose = AT_REST
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (V, 3) float64 and triangles (F, 3) int64. Raises InputError for an index without vertex."""
    _decode(primitive, numbers)
    position, indices = primitive["attributes"]["POSITION"], primitive.get("indices")
    for number in (position, *(() if indices is None else (indices,))):
        if not numbers.has_numbers(number):
            raise InputError(f"accessor {number} has no numbers, or compressed ones; export it plainly")
    vertices = moved(numbers.floats(position, 3), "POSITION", primitive, numbers, pose)
    corners = np.arange(len(vertices)) if indices is None else numbers.whole(indices)
    faces = triangles_of_mode(primitive.get("mode", TRIANGLES), corners)
    check_indices(np.broadcast_to(3, len(faces)), faces.ravel(), len(vertices))
    return vertices, faces


def _decode(primitive: Any, numbers: Numbers) -> None:
    """Let the accessors of a primitive that Draco compresses have their numbers; others have them already."""
    compressed = primitive.get("extensions", {}).get(DRACO)
    if compressed is None:
        return
    accessors = primitive["attributes"]
    named = {name: number for name, number in compressed["attributes"].items() if name in accessors}
    rows, corners = draco_rows(numbers.view(compressed["bufferView"]), named)
    numbers.decoded |= {accessors[name]: found for name, found in rows.items()}
    if "indices" in primitive:
        numbers.decoded[primitive["indices"]] = corners.astype(np.uint32)[:, None]
