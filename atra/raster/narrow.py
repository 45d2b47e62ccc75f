"""Narrow triangles, the ordinary ones: a vector or two a row, and three sums that say which of its lanes lie inside."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at, floats_at, load, store_where
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, counted, mask_of, rarely, repeated, smaller
from atra.exact.edges_kernels import side
from atra.raster.nearer import UNSURE, without_farther
from atra.raster.triangles import (
    BATCH,
    CAP,
    COLUMN,
    FIRST,
    INSIDE,
    LAST,
    LEFT,
    NEARNESS,
    RIGHT,
    ROUNDING,
    ROW,
    SLOPE_X,
    SLOPE_Y,
    corner_at,
)


@njit
def facing_of(points, packed):  # type: ignore[no-untyped-def]
    """1 or -1: which way an ordinary triangle with these corners turns."""
    x0, y0, _ = corner_at(points, packed, 0)
    x1, y1, _ = corner_at(points, packed, 1)
    x2, y2, _ = corner_at(points, packed, 2)
    return 1 if (y1 - y0) * (x0 - x2) > (x1 - x0) * (y0 - y2) else -1


@njit
def decided(points, packed, left, top, lanes, nx, exact):  # type: ignore[no-untyped-def]
    """Bits of the samples that lie in an ordinary triangle, exactly; they are in rows of nx, the first (left, top)."""
    x0, y0, _ = corner_at(points, packed, 0)
    x1, y1, _ = corner_at(points, packed, 1)
    x2, y2, _ = corner_at(points, packed, 2)
    facing, bits = facing_of(points, packed), 0
    for lane in range(lanes):
        i, j = float(left + lane % nx), float(top + lane // nx)
        if (
            side(x0, y0, x1, y1, i, j, exact) == facing
            and side(x1, y1, x2, y2, i, j, exact) == facing
            and side(x2, y2, x0, y0, i, j, exact) == facing
        ):
            bits |= 1 << lane
    return bits


@njit(forceinline=True)
def draw_narrow(lanes, parallel, eye, clusters, prim_id, packed, k, band, workspace):  # type: ignore[no-untyped-def]
    """Draw an ordinary triangle, the k-th of its batch and with these corners, with vectors of `lanes`.

    Where a sum is within its rounding of 0, `side` decides; where a sample is about as near already, `without_farther`.
    Nothing is drawn nearer than the nearest corner, whatever rounding makes of the plane.
    """
    values, doubles = floats_at(workspace.floats + k * 4), doubles_at(workspace.doubles + k * 8)
    left, right = int(values[LEFT * BATCH]), int(values[RIGHT * BATCH])
    first, last = int(values[FIRST * BATCH]), int(values[LAST * BATCH])
    slope_y, rounding = doubles[SLOPE_Y * BATCH], values[ROUNDING * BATCH]
    prim_ids, at_eye = repeated(prim_id, lanes), repeated(np.float32(0.0), lanes)
    surely, hardly = repeated(rounding, lanes), repeated(-rounding, lanes)
    most = values[CAP * BATCH]
    if parallel:  # the deepest: a gentle slope adds at most twice the least depth
        begin = doubles[NEARNESS * BATCH]
        most = np.float32(max(-begin, -begin - slope_y * (last - first)) - 2.0 * most)
    unsure = np.float32(UNSURE) * most
    doubt, less = repeated(unsure, lanes), repeated(-unsure, lanes)
    cap, slope = repeated(values[CAP * BATCH], lanes), repeated(values[SLOPE_X * BATCH], lanes)
    column0 = repeated(values[COLUMN * BATCH], lanes)
    column1 = repeated(values[(COLUMN + 1) * BATCH], lanes)
    column2 = repeated(values[(COLUMN + 2) * BATCH], lanes)
    row0 = repeated(values[ROW * BATCH], lanes)
    row1 = repeated(values[(ROW + 1) * BATCH], lanes)
    row2 = repeated(values[(ROW + 2) * BATCH], lanes)
    for start in range(left, right + 1, lanes):
        columns = counted(np.float32(start - left), lanes)
        inside0 = repeated(values[INSIDE * BATCH], lanes) + columns * column0
        inside1 = repeated(values[(INSIDE + 1) * BATCH], lanes) + columns * column1
        inside2 = repeated(values[(INSIDE + 2) * BATCH], lanes) + columns * column2
        along = columns * slope
        place, row = ((first - band.top) * band.stride + start) * 4, doubles[NEARNESS * BATCH]
        for y in range(first, last + 1):
            inside = smaller(smaller(inside0, inside1), inside2)
            found = smaller(cap, repeated(np.float32(row), lanes) + along)
            old = load(band.nearness + place, np.float32(0.0), lanes)
            ahead = found - old
            drawn = (inside > hardly) & (ahead >= less)
            if parallel:
                drawn = drawn & (at_eye > found)
            if rarely(bits_of(drawn & ((inside <= surely) | (ahead <= doubt))) != 0):
                exactly = decided(workspace.points, packed, start, y, lanes, lanes, workspace.exact)
                close = bits_of(drawn & (ahead <= doubt)) & exactly
                exactly = without_farther(
                    parallel, exactly, close, prim_id, band.prim_id + place, eye, clusters, start, y
                )
                drawn = drawn & mask_of(exactly, lanes)
            store_where(drawn, found, band.nearness + place)
            store_where(drawn, prim_ids, band.prim_id + place)
            inside0, inside1, inside2 = inside0 + row0, inside1 + row1, inside2 + row2
            place += band.stride * 4
            row += slope_y
