"""Cells of a box that no triangle reaches lie inside or outside as a whole: a point in one needs no ray."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.rays.tree.memory import CHUNK

OUTSIDE, INSIDE, UNKNOWN = 0, 1, 2

_PADDING = 1e-9
"""By which share of a cell boxes of triangles are enlarged, so that rounding puts no point beyond one."""


@njit(forceinline=True)
def _cell(x, low, inverse, count):  # type: ignore[no-untyped-def]
    return min(max(np.int64((x - low) * inverse), 0), count - 1)


@kernel
def mark_cells(vertices, faces, kept, low, inverse, cells):  # type: ignore[no-untyped-def]
    """Mark the cells that the boxes of triangles reach. cells: (X, Y, Z) uint8. low, inverse: (3,) float64, the lowest
    corner and cells per unit of length."""
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for face in range(len(faces)):
        if not kept[face]:
            continue
        for axis in range(3):
            a = np.float64(vertices[faces[face, 0], axis])
            b = np.float64(vertices[faces[face, 1], axis])
            c = np.float64(vertices[faces[face, 2], axis])
            padding = _PADDING / inverse[axis]
            first[axis] = _cell(min(a, b, c) - padding, low[axis], inverse[axis], cells.shape[axis])
            last[axis] = _cell(max(a, b, c) + padding, low[axis], inverse[axis], cells.shape[axis])
        for x in range(first[0], last[0] + 1):
            for y in range(first[1], last[1] + 1):
                for z in range(first[2], last[2] + 1):
                    cells[x, y, z] = UNKNOWN


@kernel
def look_up(counter_address, points, low, high, inverse, cells, found):  # type: ignore[no-untyped-def]
    """Write what is known of each point, (P,) uint8. points: (P, 3) float64. high: (3,) float64, highest corner."""
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(points):
            return
        for number in range(start, min(start + CHUNK, len(points))):
            x, y, z = points[number, 0], points[number, 1], points[number, 2]
            if low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]:
                i = _cell(x, low[0], inverse[0], cells.shape[0])
                j = _cell(y, low[1], inverse[1], cells.shape[1])
                k = _cell(z, low[2], inverse[2], cells.shape[2])
                found[number] = cells[i, j, k]
            else:
                found[number] = OUTSIDE
