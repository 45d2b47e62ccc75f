"""Shapes of polygons, and their fans of triangles."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit

CONCAVE, CROSSING, BENT = 1, 2, 4
"""Bits of a polygon's shape: has to be cut by ear clipping, crosses itself, does not lie in a plane."""

_NO_TURN = 1e-9
"""Largest turn to the wrong side at a corner that counts as none, as a fraction of the polygon's area."""

_FLAT = 0.01
"""Largest distance of a corner to its polygon's plane for it to count as flat, as a fraction of the polygon's size."""


@njit
def _shape(points, own):  # type: ignore[no-untyped-def]
    """The shape of a polygon of more than three corners, and the corner where its fan begins."""
    size, start = len(own), points[own[0]]
    x = y = z = apart = 0.0
    for k in range(1, size - 1):
        b, c = points[own[k]], points[own[k + 1]]
        bx, by, bz = b[0] - start[0], b[1] - start[1], b[2] - start[2]
        cx, cy, cz = c[0] - start[0], c[1] - start[1], c[2] - start[2]
        u, v, w = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        x, y, z, apart = x + u, y + v, z + w, apart + np.sqrt(u * u + v * v + w * w)
    axis = 2 if abs(z) > max(abs(x), abs(y)) else 1 if abs(y) > abs(x) else 0
    along = (x, y, z)[axis]
    area, sign, i, j = abs(along), -1.0 if along < 0.0 else 1.0, (axis + 1) % 3, (axis + 2) % 3
    if area <= _NO_TURN * apart:
        return CROSSING if apart > 0.0 else 0, 0
    # Seen along the axis nearest to the normal.
    inward, turned, worst, first = 0, 0.0, -_NO_TURN * area, 0
    for k in range(size):
        a, b, c = points[own[k]], points[own[(k + 1) % size]], points[own[(k + 2) % size]]
        turn = sign * ((b[i] - a[i]) * (c[j] - b[j]) - (b[j] - a[j]) * (c[i] - b[i]))
        inward += turn < -_NO_TURN * area
        if turn < worst:
            worst, first = turn, (k + 1) % size
        if size > 4:
            turned += np.arctan2(turn, (b[i] - a[i]) * (c[i] - b[i]) + (b[j] - a[j]) * (c[j] - b[j]))
    low = high = extent = 0.0
    for k in range(3):
        least = most = start[k]
        for corner in own:
            least, most = min(least, points[corner, k]), max(most, points[corner, k])
        extent = max(extent, most - least)
    for corner in own:
        p = points[corner]
        off = (p[0] - start[0]) * x + (p[1] - start[1]) * y + (p[2] - start[2]) * z
        low, high = min(low, off), max(high, off)
    shape = BENT if high - low > 2.0 * _FLAT * extent * np.sqrt(x * x + y * y + z * z) else 0
    if size > 4:
        return shape | (CONCAVE if inward or turned > 3.0 * np.pi else 0), 0  # or more than once around
    return (shape | CROSSING, 0) if inward > 1 else (shape, first)


@kernel
def cut_fans(points, sizes, corners, shapes, faces):  # type: ignore[no-untyped-def]
    """Find the shape (P,) uint8 of each polygon, and write its triangles (F, 3) as a fan.

    points: (V, 3) float64. sizes: (P,). corners: indices of all polygons. A fan of four corners begins where it covers
    the polygon though that is concave.
    """
    begin = place = 0
    for polygon in range(len(sizes)):
        size = sizes[polygon]
        own, start = corners[begin : begin + size], 0
        shapes[polygon] = 0
        if size > 3:
            shapes[polygon], start = _shape(points, own)
        for k in range(size - 2):
            faces[place, 0] = own[start]
            faces[place, 1] = own[(start + k + 1) % size]
            faces[place, 2] = own[(start + k + 2) % size]
            place += 1
        begin += size
