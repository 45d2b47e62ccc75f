"""Triangles on the plane of a tile: planes that projected corners do not tell, and exact decisions about samples."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at, floats_at
from atra.compiled.store import njit
from atra.raster.corners import plane_in_space
from atra.raster.image import GENTLE, SPAN
from atra.raster.set_up import CAP, LENS_FARTHEST, LENS_SLOPE_X, NEARNESS, SLOPE_Y
from atra.raster.triangles import BATCH, corner_at


@njit
def plane_through(eye, vertices, vertex_count, packed, k, margin, memory):  # type: ignore[no-untyped-def]
    """Write the plane of a triangle from its corners in space, and the nearest and farthest that is seen of it.

    Returns whether it is seen, and whether it is gentle.
    """
    doubles, floats = doubles_at(memory.doubles + k * 8), floats_at(memory.floats + k * 4)
    nearest, farthest = float(floats[CAP * BATCH]), float(floats[LENS_FARTHEST * BATCH])
    slope_x, slope_y, constant, nearest, farthest, is_seen = plane_in_space(
        eye, vertices, vertex_count, packed, memory.points, nearest, farthest
    )
    doubles[NEARNESS * BATCH], doubles[LENS_SLOPE_X * BATCH], doubles[SLOPE_Y * BATCH] = constant, slope_x, slope_y
    floats[CAP * BATCH], floats[LENS_FARTHEST * BATCH] = nearest, farthest
    return is_seen, abs(slope_x) * (SPAN + margin) + abs(slope_y) * margin <= GENTLE * floats[LENS_FARTHEST * BATCH]


@njit
def _is_inside(px, py, qx, qy, facing, i, j):  # type: ignore[no-untyped-def]
    """Whether a sample lies inside of an edge: on one of its sides only, and on the other one for the neighbour, which
    has the same edge with p and q exchanged, and so the same numbers with other signs."""
    inside, column, row = px * qy - py * qx, py - qy, qx - px
    value = (inside + column * i) + row * j
    if value == 0.0:
        value = row if row != 0.0 else column
    return value * facing > 0.0


@njit
def decided_of_lens(points, packed, places, down_places, start, y, lanes):  # type: ignore[no-untyped-def]
    """Bits of the samples that lie in a triangle, in float64; places, down_places: addresses of theirs, less start and
    y."""
    x0, y0, w0 = corner_at(points, packed, 0)
    x1, y1, w1 = corner_at(points, packed, 1)
    x2, y2, w2 = corner_at(points, packed, 2)
    facing = 1.0 if (y1 - y0) * (x0 - x2) - (x1 - x0) * (y0 - y2) > 0.0 else -1.0
    of0 = facing if w0 > 0.0 else -facing
    of1 = facing if w1 > 0.0 else -facing
    of2 = facing if w2 > 0.0 else -facing
    bits = 0
    for k in range(lanes):
        i, j = start + k + np.float64(floats_at(places)[k]), y + np.float64(floats_at(down_places)[k])
        if (
            _is_inside(x1, y1, x2, y2, of0, i, j)
            and _is_inside(x2, y2, x0, y0, of1, i, j)
            and _is_inside(x0, y0, x1, y1, of2, i, j)
        ):
            bits |= 1 << k
    return bits
