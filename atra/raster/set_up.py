"""Set-up of a batch of triangles: bounding boxes, planes and edges on the image."""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import gather_at, points_of, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, ceil, floor, larger, rounded, signed_like, smaller, splat, where
from atra.exact.sums_kernels import UNIT
from atra.raster.culling import TILE, tile_stride
from atra.raster.image import GENTLE, NARROW, SPAN
from atra.raster.nearer import UNSURE, UNSURE_OF_LENS
from atra.raster.triangles import BATCH

_UNIT32 = 2.0**-24

_SMALLEST, _LARGEST = 1e-35, 1e35
"""Float32 between these has all its digits."""

_SURE = 4.0 * UNIT
"""As in `edges_kernels`: the area is the same sum of products."""

NEAR_AND_FAR = 1e3
"""Times that the nearest corner is as near as the farthest, up to which the plane through the three projected corners
is known well enough, and cannot hold the eye. Beyond, it is computed from the corners in space."""

_ROUNDINGS, _LENS_ROUNDINGS = 10, 16.0
"""Roundings of the sum that says how far inside a sample lies; each row adds one. Through a lens, of the tile's reach:
that of each of the three numbers of an edge, of the sample's place, of two products and two sums. The first number is
at most twice the reach."""

_BLOCK_ROWS = 2
"""Rows that may be drawn at once, a divisor of those of a band: the first may lie above a triangle, the last below."""

_ASIDE = 5.0
"""Times the least depth that a row of parallel rays may begin deeper than the deepest corner: a gentle slope adds twice
that along a row, and as much from the row's samples to its begin."""

NEARNESS, SLOPE_Y, LENS_SLOPE_X = 0, 1, 2
"""Places in a set-up of what is float64, in units of a batch: nearness in the first row and column, and from row to
row. Through a lens, nearness in row 0 and column 0, and from column to column."""

LEFT, RIGHT, FIRST, LAST, SLOPE_X, CAP, ROUNDING = range(7)
INSIDE, ROW, COLUMN, LENS_FARTHEST = 7, 10, 13, 16
"""Places of what is float32: first and last column, first and last row, nearness from column to column and that of the
nearest corner, up to what sums and differences of nearness are undecided, and for each edge how far inside of it the
first sample lies, and what the next row and the next column add to that, in units that make both roundings equal.
Through a lens, how far inside lies column 0 of row 0, in units that make both slopes sum up to 1 in size, and nearness
of the farthest corner."""

DOUBLES, FLOATS = 3, 17


@njit(forceinline=True)
def _are_hidden(left, right, first, last, nearest, width, tiles):  # type: ignore[no-untyped-def]
    """The triangles of a batch in up to 2 x 2 tiles that are farther than all that is drawn there.

    left, right, first, last: first and last column and row, counted from the band's first.
    """
    share, stride = splat(1.0 / TILE, BATCH), splat(float(tile_stride(width)), BATCH)
    left_tile, right_tile = floor(left * share), floor(right * share)
    top_tile, bottom_tile = floor(first * share), floor(last * share)
    upper, lower, one = top_tile * stride, bottom_tile * stride, splat(1.0, BATCH)
    least_there = smaller(
        smaller(gather_at(tiles, upper + left_tile), gather_at(tiles, upper + right_tile)),
        smaller(gather_at(tiles, lower + left_tile), gather_at(tiles, lower + right_tile)),
    )
    return (least_there > rounded(nearest)) & (one >= right_tile - left_tile) & (one >= bottom_tile - top_tile)


@njit
def set_up(lens, parallel, hides, has_depth, margin, width, number, band, memory):  # type: ignore[no-untyped-def]
    """Write what drawing a batch of listed triangles, from one number on, starts from; returns two numbers with a bit
    for each: those that may be nearer than what is drawn, and of these the ordinary: narrow, gentle, and wholly in
    front of the eye. The others are drawn by their corners alone.

    hides: a triangle in up to 2 x 2 tiles is hidden if its nearest corner is farther than all that is drawn there;
    otherwise all may be seen. has_depth: nearness is written; otherwise steep triangles are ordinary, too. margin: how
    far samples may lie beside whole numbers. lens: they may; then a triangle of any width is ordinary, the plane of
    others is found by `plane_through`, and a triangle that reaches behind the eye may be anywhere.
    """
    base, doubles, floats = memory.points, memory.doubles, memory.floats
    listed = memory.listed + number * 8
    x0, y0, w0 = points_of(base, listed, 0)
    x1, y1, w1 = points_of(base, listed, 1)
    x2, y2, w2 = points_of(base, listed, 2)
    nearest, farthest = larger(larger(w0, w1), w2), smaller(smaller(w0, w1), w2)
    low_x, high_x = smaller(smaller(x0, x1), x2), larger(larger(x0, x1), x2)
    low_y, high_y = smaller(smaller(y0, y1), y2), larger(larger(y0, y1), y2)
    zero, one, wider = splat(0.0, BATCH), splat(1.0, BATCH), splat(margin, BATCH)
    last_column, first_row = splat(width - 1.0, BATCH), splat(float(band.top), BATCH)
    last_row, in_front = splat(float(band.bottom), BATCH), farthest > zero
    if lens:
        low_x, high_x = where(in_front, low_x - wider, zero), where(in_front, high_x + wider, last_column)
        low_y, high_y = where(in_front, low_y - wider, zero), where(in_front, high_y + wider, last_row)
    left = smaller(ceil(larger(low_x, zero)), last_column)
    right = floor(larger(smaller(high_x, last_column), zero))
    top = ceil(larger(low_y, zero))
    first = smaller(larger(top, first_row), last_row)
    last = floor(larger(smaller(high_y, last_row), first_row))
    may_be_seen = (1 << BATCH) - 1
    if hides:
        unsure_of = UNSURE_OF_LENS if lens else UNSURE
        limit = splat(1.0 - unsure_of if parallel else 1.0 + unsure_of, BATCH) * nearest
        hidden = _are_hidden(left, right, first - first_row, last - first_row, limit, width, memory.tiles)
        if not parallel:
            hidden = hidden & in_front
        may_be_seen ^= bits_of(hidden)
        if may_be_seen == 0:
            return 0, 0
    _store_rounded(left, floats, LEFT)
    _store_rounded(right, floats, RIGHT)
    _store_rounded(first, floats, FIRST)
    _store_rounded(last, floats, LAST)
    _store_rounded(nearest, floats, CAP)
    # Edge k lies opposite corner k.
    dx0, dy0, dx1, dy1, dx2, dy2 = x2 - x1, y2 - y1, x0 - x2, y0 - y2, x1 - x0, y1 - y0
    one_way, other_way = dx2 * dy1, dy2 * dx1
    area = other_way - one_way
    if lens:
        facing = signed_like(one, area)
        may_be_seen &= bits_of(
            (abs(area) > zero)
            & _store_lens_edge(0, margin, width, x1, y1, x2, y2, dx0, dy0, signed_like(facing, facing * w0), floats)
            & _store_lens_edge(1, margin, width, x2, y2, x0, y0, dx1, dy1, signed_like(facing, facing * w1), floats)
            & _store_lens_edge(2, margin, width, x0, y0, x1, y1, dx2, dy2, signed_like(facing, facing * w2), floats)
        )
        if may_be_seen == 0:
            return 0, 0
        slope_x, slope_y = _slopes(w0, w1, w2, dx1, dy1, dx2, dy2, area)
        steepness = abs(slope_x) * splat(SPAN + margin, BATCH) + abs(slope_y) * wider
        ordinary = in_front & (splat(GENTLE, BATCH) * farthest >= steepness)
        store(w0 - slope_x * x0 - slope_y * y0, doubles + NEARNESS * BATCH * 8)
        store(slope_y, doubles + SLOPE_Y * BATCH * 8)
        store(slope_x, doubles + LENS_SLOPE_X * BATCH * 8)
        _store_rounded(farthest, floats, LENS_FARTHEST)
        return may_be_seen, bits_of(ordinary & (splat(NEAR_AND_FAR, BATCH) * farthest >= nearest))
    # No sum and no summand is larger, from the first row and column to the last of a vector.
    across = high_x - low_x
    largest = (high_y - low_y + splat(float(_BLOCK_ROWS), BATCH)) * (across + across + splat(float(SPAN), BATCH))
    ordinary = (
        (splat(float(NARROW), BATCH) > right - left)
        & (splat(_LARGEST, BATCH) > largest)
        & (abs(area) > splat(_SURE, BATCH) * (abs(one_way) + abs(other_way)))
    )
    if not parallel:
        ordinary = ordinary & (splat(NEAR_AND_FAR, BATCH) * farthest >= nearest) & in_front
    roundings = (last - first + splat(float(_ROUNDINGS), BATCH)) * splat(_UNIT32, BATCH)
    unit, rounding = one, roundings * largest + splat(_SMALLEST, BATCH)
    if has_depth:
        slope_x, slope_y = _slopes(w0, w1, w2, dx1, dy1, dx2, dy2, area)
        least = zero - nearest if parallel else farthest
        deepest = splat(_ASIDE, BATCH) * least - farthest if parallel else nearest
        ordinary = ordinary & (splat(GENTLE, BATCH) * least >= abs(slope_x) * splat(float(NARROW), BATCH))
        ordinary = ordinary & (deepest > splat(_SMALLEST, BATCH))
        nearness = w0 + slope_x * (left - x0) + slope_y * (top - y0) + slope_y * (first - top)
        store(nearness, doubles + NEARNESS * BATCH * 8)
        store(slope_y, doubles + SLOPE_Y * BATCH * 8)
        _store_rounded(slope_x, floats, SLOPE_X)
        unsure = splat(UNSURE, BATCH) * deepest
        unit, rounding = unsure / rounding, unsure
    _store_rounded(rounding, floats, ROUNDING)
    facing = signed_like(unit, area)
    _store_edge(0, facing * dx0, facing * dy0, left - x1, first - y1, floats)
    _store_edge(1, facing * dx1, facing * dy1, left - x2, first - y2, floats)
    _store_edge(2, facing * dx2, facing * dy2, left - x0, first - y0, floats)
    return may_be_seen, bits_of(ordinary)


@njit(forceinline=True)
def _slopes(w0, w1, w2, dx1, dy1, dx2, dy2, area):  # type: ignore[no-untyped-def]
    """Change of nearness from column to column and from row to row."""
    inverse, nearer1, nearer2 = splat(1.0, BATCH) / area, w1 - w0, w2 - w0
    slope_x = splat(0.0, BATCH) - (nearer2 * dy2 + nearer1 * dy1) * inverse
    return slope_x, (nearer2 * dx2 + nearer1 * dx1) * inverse


@njit(forceinline=True)
def _store_edge(edge, dx, dy, x, y, floats):  # type: ignore[no-untyped-def]
    """Write an edge (dx, dy), positive inside; x, y: from its first corner to the first sample."""
    _store_rounded(dx * y - dy * x, floats, INSIDE + edge)
    _store_rounded(dx, floats, ROW + edge)
    _store_rounded(splat(0.0, BATCH) - dy, floats, COLUMN + edge)


@njit(forceinline=True)
def edges_at(values, lanes):  # type: ignore[no-untyped-def]
    """How far inside each edge of a triangle the first sample lies, in each lane, and what the next column and the next
    row add to that; three tuples of three. values: those of the triangle's place in a batch."""
    return _three_of(values, INSIDE, lanes), _three_of(values, COLUMN, lanes), _three_of(values, ROW, lanes)


@njit(forceinline=True)
def _three_of(values, place, lanes):  # type: ignore[no-untyped-def]
    one, two, three = values[place * BATCH], values[(place + 1) * BATCH], values[(place + 2) * BATCH]
    return splat(one, lanes), splat(two, lanes), splat(three, lanes)


@njit
def reach_of(side, margin):  # type: ignore[no-untyped-def]
    """Upper limit of the places of samples in a tile."""
    return side + margin


@njit
def rounding_of(side, margin):  # type: ignore[no-untyped-def]
    """Distance from an edge in pixels up to which float32 does not decide, through a lens."""
    return np.float32(_LENS_ROUNDINGS * _UNIT32 * reach_of(side, margin))


@njit(forceinline=True)
def _store_lens_edge(edge, margin, side, px, py, qx, qy, dx, dy, facing, floats):  # type: ignore[no-untyped-def]
    """Write the edge from p to q, with d = q - p, so that it is positive inside and its slopes sum up to 1 in size.
    Returns where a sample of the tile may be inside."""
    zero, scale = splat(0.0, BATCH), facing / (abs(dx) + abs(dy))
    most = splat(2.0 * reach_of(side, margin), BATCH)
    inside = smaller(larger((px * qy - py * qx) * scale, zero - most), most)
    column, row = zero - dy * scale, dx * scale
    _store_rounded(inside, floats, INSIDE + edge)
    _store_rounded(column, floats, COLUMN + edge)
    _store_rounded(row, floats, ROW + edge)
    lowest, highest = splat(-margin, BATCH), splat(side - 1.0 + margin, BATCH)
    farthest = larger(column * lowest, column * highest) + larger(row * lowest, row * highest)
    return inside + farthest >= splat(-np.float64(rounding_of(side, margin)), BATCH)


@njit(forceinline=True)
def _store_rounded(numbers, floats, place):  # type: ignore[no-untyped-def]
    store(rounded(numbers), floats + place * BATCH * 4)
