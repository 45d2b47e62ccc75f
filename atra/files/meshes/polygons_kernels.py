"""Shapes of polygons, and fans of triangles."""

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
def _cross(a, b, c, axis):  # type: ignore[no-untyped-def]
    """Part `axis` of the cross product of two edges of a triangle."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    return (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j])


@njit
def _is_bent(vertices, corners, first, size, normal):  # type: ignore[no-untyped-def]
    """Whether corners lie off the plane through the mean of all, by more than _FLAT of the polygon's size."""
    extent, low, high = 0.0, np.inf, -np.inf
    for axis in range(3):
        least, most = np.inf, -np.inf
        for k in range(size):
            here = vertices[corners[first + k], axis]
            least, most = min(least, here), max(most, here)
        extent = max(extent, most - least)
    start = vertices[corners[first]]
    for k in range(size):
        here = vertices[corners[first + k]]
        off = (here[0] - start[0]) * normal[0] + (here[1] - start[1]) * normal[1] + (here[2] - start[2]) * normal[2]
        low, high = min(low, off), max(high, off)
    return high - low > 2.0 * _FLAT * extent * np.sqrt((normal * normal).sum())


@kernel
def find_shapes(vertices, sizes, corners, shapes, starts):  # type: ignore[no-untyped-def]
    """Find the shape of each polygon, and the corner where a fan of triangles begins.

    vertices: (V, 3) float64, finite where used. sizes, shapes, starts: (P,). corners: indices of all polygons.
    """
    first, normal = 0, np.empty(3)
    for polygon in range(len(sizes)):
        size = sizes[polygon]
        shapes[polygon] = starts[polygon] = 0
        if size > 3:
            start = vertices[corners[first]]
            apart = 0.0
            normal[:] = 0.0
            for k in range(1, size - 1):
                b, c = vertices[corners[first + k]], vertices[corners[first + k + 1]]
                square = 0.0
                for axis in range(3):
                    part = _cross(start, b, c, axis)
                    normal[axis] += part
                    square += part * part
                apart += np.sqrt(square)
            axis = np.argmax(np.abs(normal))
            area, sign = abs(normal[axis]), 1.0 if normal[axis] >= 0.0 else -1.0
            inward, turned, worst = 0, 0.0, 0.0
            j, i = (axis + 1) % 3, (axis + 2) % 3
            for k in range(size):
                a, b = vertices[corners[first + k]], vertices[corners[first + (k + 1) % size]]
                c = vertices[corners[first + (k + 2) % size]]
                turn = sign * _cross(a, b, c, axis)
                if size > 4:
                    along = (b[j] - a[j]) * (c[j] - b[j]) + (b[i] - a[i]) * (c[i] - b[i])
                    turned += np.arctan2(turn, along)
                if turn < -_NO_TURN * area:
                    inward += 1
                    if turn < worst:
                        worst, starts[polygon] = turn, (k + 1) % size
            if area <= _NO_TURN * apart:
                shapes[polygon] = CROSSING if apart > 0.0 else 0
            elif size == 4 and inward > 1:
                shapes[polygon] = CROSSING
            elif size > 4 and (inward > 0 or turned > 3.0 * np.pi):  # more than once around
                shapes[polygon] = CONCAVE
            if size > 4 or shapes[polygon] == CROSSING:
                starts[polygon] = 0
            if area > _NO_TURN * apart and _is_bent(vertices, corners, first, size, normal):
                shapes[polygon] |= BENT
        first += size


@kernel
def make_fans(sizes, corners, counts, starts, is_fan, faces, polygon_of):  # type: ignore[no-untyped-def]
    """Write the triangles (F, 3) of polygons that are fans, and the polygon (F,) of every triangle.

    counts: (P,), triangles of each polygon; where not `is_fan` their place is left as it is.
    """
    first = place = 0
    for polygon in range(len(sizes)):
        size = sizes[polygon]
        for k in range(counts[polygon]):
            if is_fan[polygon]:
                for corner in range(3):
                    step = k + corner if corner else 0
                    faces[place, corner] = corners[first + (starts[polygon] + step) % size]
            polygon_of[place] = polygon
            place += 1
        first += size
