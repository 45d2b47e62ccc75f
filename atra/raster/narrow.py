"""Narrow triangles, the ordinary ones: a vector or two a row, and three sums that say which of its lanes lie inside."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at, floats_at, load, store_where
from atra.compiled.store import njit
from atra.compiled.vectors import arange, bits_of, mask_of, smaller, splat
from atra.exact.edges_kernels import side
from atra.raster.nearer import FEW, nearness_along, without_farther
from atra.raster.set_up import CAP, FIRST, LAST, LEFT, NEARNESS, RIGHT, ROUNDING, SLOPE_X, SLOPE_Y, edges_at
from atra.raster.triangles import BATCH, corner_at


@njit
def winding(points, packed):  # type: ignore[no-untyped-def]
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
    facing, bits = winding(points, packed), 0
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
def draw_narrow(lanes, parallel, exactly, eye, clusters, prim_id, packed, k, band, memory):  # type: ignore[no-untyped-def]
    """Draw of an ordinary triangle, the k-th of its batch and with these corners, what lies surely in it and surely
    before what is drawn, with vectors of `lanes`; returns whether others are undecided. exactly: draw those, too.

    A sample is as sure as the least of how far inside it lies and how far before what is drawn, which `set_up` measures
    in one unit. Nothing is drawn nearer than the nearest corner, whatever rounding makes of the plane.
    """
    values, doubles = floats_at(memory.floats + k * 4), doubles_at(memory.doubles + k * 8)
    left, right = int(values[LEFT * BATCH]), int(values[RIGHT * BATCH])
    first, last = int(values[FIRST * BATCH]), int(values[LAST * BATCH])
    slope_y, rounding = doubles[SLOPE_Y * BATCH], splat(values[ROUNDING * BATCH], lanes)
    prim_ids, at_eye = splat(prim_id, lanes), splat(np.float32(0.0), lanes)
    cap, slope = splat(values[CAP * BATCH], lanes), splat(values[SLOPE_X * BATCH], lanes)
    (first0, first1, first2), (column0, column1, column2), (row0, row1, row2) = edges_at(values, lanes)
    least = splat(np.float32(np.inf), lanes)
    for start in range(left, right + 1, lanes):
        columns = arange(np.float32(start - left), lanes)
        inside0, inside1, inside2 = first0 + columns * column0, first1 + columns * column1, first2 + columns * column2
        along = columns * slope
        place, row = ((first - band.top) * band.stride + start) * 4, doubles[NEARNESS * BATCH]
        for y in range(first, last + 1):
            found = smaller(cap, splat(np.float32(row), lanes) + along)
            old = load(band.nearness + place, np.float32(0.0), lanes)
            sure = smaller(smaller(smaller(inside0, inside1), inside2), found - old)
            if parallel:
                sure = smaller(sure, at_eye - found)
            unsure = abs(sure)
            if exactly:
                ids = band.prim_id + place
                others = load(ids, np.uint32(0), lanes) != prim_ids
                bits = bits_of(others & (unsure <= rounding))
                if bits != 0:
                    bits &= decided(memory.points, packed, start, y, lanes, lanes, memory.exact)
                    if parallel:
                        bits &= bits_of(at_eye > found)
                    own, close = nearness_along(parallel, eye, clusters, prim_id, y), bits_of(found - old <= rounding)
                    bits, _, _ = without_farther(
                        parallel, bits, bits & close, prim_id, own, prim_id, own, ids, eye, clusters, start, y
                    )
                    store_where(mask_of(bits, lanes), found, band.nearness + place)
                    store_where(mask_of(bits, lanes), prim_ids, ids)
            else:
                store_where(sure > rounding, found, band.nearness + place)
                store_where(sure > rounding, prim_ids, band.prim_id + place)
                least = smaller(least, unsure)
            inside0, inside1, inside2 = inside0 + row0, inside1 + row1, inside2 + row2
            place += band.stride * 4
            row += slope_y
    return bits_of(least <= rounding) != 0


@njit
def decide_narrow(parallel, eye, clusters, prim_id, packed, k, band, memory):  # type: ignore[no-untyped-def]
    """Draw the samples that `draw_narrow` left undecided: `side` decides what lies inside, `without_farther` what is
    nearer. Among its rows, a call of these would have vectors kept in memory."""
    draw_narrow(FEW, parallel, True, eye, clusters, prim_id, packed, k, band, memory)
