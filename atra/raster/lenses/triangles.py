"""Triangles of a cluster on the plane of a tile: those that may hold a sample, and what drawing them starts from."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import doubles_at, floats_at, integers_at, load, points_of, store
from atra.compiled.store import njit
from atra.compiled.vectors import (
    bits_of,
    ceil,
    floor,
    lane,
    larger,
    signed_like,
    smaller,
    splat,
    where,
    with_lane,
)
from atra.raster.image import GENTLE, SPAN
from atra.raster.nearer import UNSURE
from atra.raster.spans import from_eye, holds_eye, pinhole_plane
from atra.raster.triangles import BATCH, NEAR_AND_FAR, are_hidden, corner_at, store_rounded

CONSTANT, ALONG, DOWN = 0, 1, 2
"""Places in a set-up of what is float64, in units of a batch: nearness in column 0 of row 0, and what the next column
and the next row add."""

LEFT, RIGHT, FIRST, LAST, NEAREST, FARTHEST, INSIDE, COLUMN, ROW = 0, 1, 2, 3, 4, 5, 6, 9, 12
"""Places of what is float32: first and last column, first and last row, nearness of the nearest and the farthest
corner, and for each edge how far inside of it column 0 of row 0 lies, and what the next column and row add to that. The
last two sum up to 1 in size."""

UNSURE_OF_LENS = 2.0 * UNSURE
"""As UNSURE: samples beside whole numbers add as many roundings, those of what a row and a column add."""

_UNIT32 = 2.0**-24

_ROUNDINGS = 16.0
"""Roundings of a sum that says how far inside a sample lies, of the tile's reach: that of each of the three numbers of
an edge, of the sample's place, of two products and two sums. The first number is at most twice the reach."""


@njit
def reach_of(side, margin):  # type: ignore[no-untyped-def]
    """Upper limit of the places of samples in a tile."""
    return side + margin


@njit
def doubt_of(side, margin):  # type: ignore[no-untyped-def]
    """Distance from an edge in pixels up to which float32 does not decide."""
    return np.float32(_ROUNDINGS * _UNIT32 * reach_of(side, margin))


@njit
def list_near(corners, count, points, side, margin, listed):  # type: ignore[no-untyped-def]
    """List those of `count` triangles, by their corners, whose box may hold a sample of the tile; returns how many.

    As in `atra.raster.triangles.list_triangles` nothing branches on what is common.
    """
    triangles, list_ = integers_at(corners), integers_at(listed)
    before = with_lane(with_lane(splat(-np.inf, 4), 0, -margin), 1, -margin)
    end = with_lane(with_lane(splat(np.inf, 4), 0, side - 1.0 + margin), 1, side - 1.0 + margin)
    place = 0
    for k in range(count):
        packed = triangles[k]
        p0 = load(points + (packed & 0xFFFF), 0.0, 4)
        p1 = load(points + (packed >> 16 & 0xFFFF), 0.0, 4)
        p2 = load(points + (packed >> 32 & 0xFFFF), 0.0, 4)
        low, high = smaller(smaller(p0, p1), p2), larger(larger(p0, p1), p2)
        is_seen = bits_of((high >= before) & (end >= low)) & 3 == 3
        if not lane(low, 2) > 0.0:
            is_seen = lane(high, 2) > 0.0
        list_[place] = packed
        place += is_seen
    return place


@njit
def set_up(side, margin, number, workspace):  # type: ignore[no-untyped-def]
    """Write what drawing a batch of listed triangles, from one number on, starts from; returns two numbers with a bit
    for each: those that may be nearer than what is drawn, and of these the ones whose plane is known from their
    projected corners. The plane of others is found by `plane_through`."""
    base, doubles, floats = workspace.points, workspace.doubles, workspace.floats
    listed = workspace.listed + number * 8
    x0, y0, w0 = points_of(base, listed, 0)
    x1, y1, w1 = points_of(base, listed, 1)
    x2, y2, w2 = points_of(base, listed, 2)
    nearest, farthest = larger(larger(w0, w1), w2), smaller(smaller(w0, w1), w2)
    zero, one, wider = splat(0.0, BATCH), splat(1.0, BATCH), splat(margin, BATCH)
    end, in_front = splat(side - 1.0, BATCH), farthest > zero
    # A triangle that reaches behind the eye may be anywhere.
    left = where(in_front, ceil(larger(smaller(smaller(x0, x1), x2) - wider, zero)), zero)
    right = where(in_front, floor(smaller(larger(larger(x0, x1), x2) + wider, end)), end)
    first = where(in_front, ceil(larger(smaller(smaller(y0, y1), y2) - wider, zero)), zero)
    last = where(in_front, floor(smaller(larger(larger(y0, y1), y2) + wider, end)), end)
    # Edge k lies opposite corner k.
    dx0, dy0, dx1, dy1, dx2, dy2 = x2 - x1, y2 - y1, x0 - x2, y0 - y2, x1 - x0, y1 - y0
    area = dy2 * dx1 - dx2 * dy1
    may_be_seen = bits_of((right >= left) & (last >= first) & (abs(area) > zero))
    limit = nearest * splat(1.0 + UNSURE_OF_LENS, BATCH)
    may_be_seen &= ~bits_of(in_front & are_hidden(left, right, first, last, limit, side, workspace.tiles))
    if may_be_seen == 0:
        return 0, 0
    facing = signed_like(one, area)
    may_be_seen &= bits_of(
        _store_edge(0, side, margin, x1, y1, x2, y2, dx0, dy0, signed_like(facing, facing * w0), floats)
        & _store_edge(1, side, margin, x2, y2, x0, y0, dx1, dy1, signed_like(facing, facing * w1), floats)
        & _store_edge(2, side, margin, x0, y0, x1, y1, dx2, dy2, signed_like(facing, facing * w2), floats)
    )
    if may_be_seen == 0:
        return 0, 0
    inverse, nearer1, nearer2 = one / area, w1 - w0, w2 - w0
    along = zero - (nearer2 * dy2 + nearer1 * dy1) * inverse
    down = (nearer2 * dx2 + nearer1 * dx1) * inverse
    steepness = abs(along) * splat(SPAN + margin, BATCH) + abs(down) * wider
    ordinary = (
        in_front & (splat(GENTLE, BATCH) * farthest >= steepness) & (splat(NEAR_AND_FAR, BATCH) * farthest >= nearest)
    )
    store(w0 - along * x0 - down * y0, doubles + CONSTANT * BATCH * 8)
    store(along, doubles + ALONG * BATCH * 8)
    store(down, doubles + DOWN * BATCH * 8)
    for place, numbers in (
        (LEFT, left),
        (RIGHT, right),
        (FIRST, first),
        (LAST, last),
        (NEAREST, nearest),
        (FARTHEST, farthest),
    ):
        store_rounded(numbers, floats, place)
    return may_be_seen, bits_of(ordinary)


@njit(forceinline=True)
def _store_edge(edge, side, margin, px, py, qx, qy, dx, dy, facing, floats):  # type: ignore[no-untyped-def]
    """Write the edge from p to q, with d = q - p, so that it is positive inside and its slopes sum up to 1 in size.
    Returns where a sample of the tile may be inside."""
    zero, scale = splat(0.0, BATCH), facing / (abs(dx) + abs(dy))
    most = splat(2.0 * reach_of(side, margin), BATCH)
    inside = smaller(larger((px * qy - py * qx) * scale, zero - most), most)
    column, row = zero - dy * scale, dx * scale
    store_rounded(inside, floats, INSIDE + edge)
    store_rounded(column, floats, COLUMN + edge)
    store_rounded(row, floats, ROW + edge)
    lowest, highest = splat(-margin, BATCH), splat(side - 1.0 + margin, BATCH)
    farthest = larger(column * lowest, column * highest) + larger(row * lowest, row * highest)
    return inside + farthest >= splat(-np.float64(doubt_of(side, margin)), BATCH)


@njit
def plane_through(eye, vertices, vertex_count, packed, k, margin, workspace):  # type: ignore[no-untyped-def]
    """Write the plane of a triangle from its corners in space, and the nearest and farthest that is seen of it.

    Returns whether it is seen, and whether it is gentle.
    """
    doubles, floats = doubles_at(workspace.doubles + k * 8), floats_at(workspace.floats + k * 4)
    a = from_eye(eye, vertices, vertex_count, packed, 0)
    b = from_eye(eye, vertices, vertex_count, packed, 1)
    c = from_eye(eye, vertices, vertex_count, packed, 2)
    along, down, constant = pinhole_plane(doubles_at(eye.to_pixels), a, b, c)
    doubles[CONSTANT * BATCH], doubles[ALONG * BATCH], doubles[DOWN * BATCH] = constant, along, down
    nearest, farthest = floats[NEAREST * BATCH], floats[FARTHEST * BATCH]
    if nearest > NEAR_AND_FAR * farthest and holds_eye(doubles_at(eye.position), a, b, c):
        return False, False
    if farthest < 0.0:
        nearest, farthest = np.float32(np.inf), np.float32(np.inf)
        for corner in range(3):
            w = np.float32(corner_at(workspace.points, packed, corner)[2])
            farthest = min(farthest, w if w > 0.0 else np.float32(np.inf))
        floats[NEAREST * BATCH], floats[FARTHEST * BATCH] = nearest, farthest
    return True, abs(along) * (SPAN + margin) + abs(down) * margin <= GENTLE * farthest


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
def decided(points, packed, places, down_places, start, y, lanes):  # type: ignore[no-untyped-def]
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
