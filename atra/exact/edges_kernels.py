"""Exact sides of edges: on which side of an edge a sample lies, without rounding.

An edge runs between two projected corners p and q, float64, and a sample lies at whole numbers (i, j). Its side is the
sign of

    (q.x - p.x) (j - p.y) - (q.y - p.y) (i - p.x)

computed in float64 where that is sure; otherwise its six products, each the sum of two float64, are summed without
error. A sample on the line counts as moved by (e, e^2) with an infinitely small e > 0: the sign is that of -dy, or of
dx if dy is 0. So every sample is on exactly one side of an edge, and none slips through between triangles that share
the edge.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at
from atra.compiled.store import njit
from atra.exact.sums_kernels import UNIT, add_product, sign_of

SUMMANDS = 12
"""Summands of an exact sum; callers provide the address of memory for as many float64."""

_SURE = 4.0 * UNIT
"""Largest error of the difference, a share of the sizes of its two products: three roundings and a little more."""

_CROSSING_ROUNDINGS = 8.0
"""Largest error of a crossing in roundings of its summands; there are 6: three differences, quotient, product, sum."""

SURELY_NEAREST = 0.25
"""Error in pixels below which a crossing is next to only one whole number."""


@njit
def turn(px, py, qx, qy, x, y, exact):  # type: ignore[no-untyped-def]
    """The exact sign, -1, 0 or 1, of (qx - px) (y - py) - (qy - py) (x - px); exact: address of SUMMANDS float64."""
    left, right = (qx - px) * (y - py), (qy - py) * (x - px)
    found = left - right
    if abs(found) > _SURE * (abs(left) + abs(right)):
        return 1 if found > 0.0 else -1
    sum_ = doubles_at(exact)
    count = add_product(sum_, 0, px, qy)
    count = add_product(sum_, count, -qx, py)
    count = add_product(sum_, count, y, qx)
    count = add_product(sum_, count, -y, px)
    count = add_product(sum_, count, -x, qy)
    return sign_of(sum_, add_product(sum_, count, x, py))


@njit
def side(px, py, qx, qy, i, j, exact):  # type: ignore[no-untyped-def]
    """The side of the edge that sample (i, j) lies on, 1 or -1; 0 only for an edge of length 0."""
    found = turn(px, py, qx, qy, i, j, exact)
    if found != 0:
        return found
    if qy != py:
        return -1 if qy > py else 1
    return 1 if qx > px else -1 if qx < px else 0


@njit(forceinline=True)
def crossing_error(x, way):  # type: ignore[no-untyped-def]
    """Largest error, in pixels, of the place x + way at which an edge crosses a row; x: of a corner."""
    return _CROSSING_ROUNDINGS * UNIT * (abs(x) + 2.0 * abs(way))


@njit
def first_beyond(px, py, qx, qy, j, width, exact):  # type: ignore[no-untyped-def]
    """The first sample of row j, 0 ... width, at which `side` changes; width = none. The edge pq must not be level."""
    upward = -1 if qy > py else 1
    ax, ay = (px, py) if abs(px) + abs(py) < abs(qx) + abs(qy) else (qx, qy)  # the nearer corner errs less
    way = (j - ay) * ((qx - px) / (qy - py))
    crossing = ax + way
    error = crossing_error(ax, way)
    if crossing + error < 0.0:
        return 0
    if crossing - error > width:
        return width
    nearest = np.rint(crossing)
    if abs(crossing - nearest) > error:
        return int(min(max(np.ceil(crossing), 0.0), width))
    if error < SURELY_NEAREST:
        first = int(nearest)
        if side(px, py, qx, qy, float(first), j, exact) != upward:
            first += 1
        return min(max(first, 0), width)
    low, high = 0, width
    while low < high:
        middle = (low + high) // 2
        if side(px, py, qx, qy, float(middle), j, exact) == upward:
            high = middle
        else:
            low = middle + 1
    return low
