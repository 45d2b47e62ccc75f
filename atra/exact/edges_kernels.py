"""Exact decisions: on which side of an edge a sample lies, without any rounding.

An edge runs between two projected corners p and q, float64 as they are stored, and a sample lies at whole numbers (i,
j). On which side it lies is the sign of

    (q.x - p.x) (j - p.y) - (q.y - p.y) (i - p.x)

computed in float64 where that is sure, and otherwise summed without error from the six products it consists of, each
the sum of two float64. Where it is 0 the sample lies on the line and counts as moved by (e, e^2), e > 0 smaller than
any number: the sign is that of -dy, or of dx where dy is 0. So there is no sample that is on neither or on both sides
of an edge, however many triangles share it, and none can slip through between them: each triangle is the
intersection of the sides of its edges, and the sides of moved samples are those of a real point near by.
Source: J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", 1997.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at
from atra.compiled.store import njit
from atra.compiled.vectors import multiply_add

SUMMANDS = 12
"""Of an exact sum: callers hand over the address of room for so many float64."""

UNIT = 2.0**-53
"""Largest relative error of one rounding in float64."""

_SURE = 4.0 * UNIT
"""Share of the two products' sizes that their difference may be wrong by: three roundings, and a little more."""

_CROSSING_ROUNDINGS = 8.0
"""Roundings, of its summands, that a crossing may be off by: 2 differences, their quotient, a difference, a product
and a sum are 6."""

SURELY_NEAREST = 0.25
"""Pixels; a crossing known to this is next to one whole number only."""


@njit(forceinline=True)
def _add_product(sum_, count, a, b):  # type: ignore[no-untyped-def]
    """Add a b to an exact sum of `count` float64, none of which overlap, ascending in size; returns their number."""
    high = a * b
    for part in (multiply_add(a, b, -high), high):
        for k in range(count):
            total = part + sum_[k]
            other = total - part
            sum_[k] = (part - (total - other)) + (sum_[k] - other)
            part = total
        sum_[count] = part
        count += 1
    return count


@njit
def turn(px, py, qx, qy, x, y, exact):  # type: ignore[no-untyped-def]
    """The exact sign, -1, 0 or 1, of (qx - px) (y - py) - (qy - py) (x - px); exact: see SUMMANDS."""
    left, right = (qx - px) * (y - py), (qy - py) * (x - px)
    found = left - right
    if not abs(found) > _SURE * (abs(left) + abs(right)):
        sum_ = doubles_at(exact)
        count = _add_product(sum_, 0, px, qy)
        count = _add_product(sum_, count, -qx, py)
        count = _add_product(sum_, count, y, qx)
        count = _add_product(sum_, count, -y, px)
        count = _add_product(sum_, count, -x, qy)
        count = _add_product(sum_, count, x, py)
        found = 0.0
        for k in range(count):  # the largest that is not 0 has the sign of them all
            if sum_[k] != 0.0:
                found = sum_[k]
    return 1 if found > 0.0 else -1 if found < 0.0 else 0


@njit
def side(px, py, qx, qy, i, j, exact):  # type: ignore[no-untyped-def]
    """1 or -1, the side of the edge that sample (i, j) lies on; 0 only for an edge of no length."""
    found = turn(px, py, qx, qy, i, j, exact)
    if found != 0:
        return found
    if qy != py:
        return -1 if qy > py else 1
    return 1 if qx > px else -1 if qx < px else 0


@njit(forceinline=True)
def crossing_error(x, way):  # type: ignore[no-untyped-def]
    """Largest error, pixels, of where an edge crosses a row: x of a corner plus the way from there."""
    return _CROSSING_ROUNDINGS * UNIT * (abs(x) + 2.0 * abs(way))


@njit
def first_beyond(px, py, qx, qy, j, width, exact):  # type: ignore[no-untyped-def]
    """The first sample of row j, among 0 ... width, right of or on the line through p and q, which is not level.

    `width` where there is none before. It is where `side` changes, found in float64 where that is sure.
    """
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
