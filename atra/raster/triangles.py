"""Triangles of one cluster: its vertices in pixels, those that may hold a sample, and what drawing them starts from."""

from __future__ import annotations

import numpy as np

from atra.compiled.lanes import store_chosen
from atra.compiled.memory import (
    doubles_at,
    gather_at,
    integers_at,
    load,
    places_of,
    points_of,
    store,
    store_points,
)
from atra.compiled.store import njit
from atra.compiled.vectors import (
    bits_of,
    lane,
    larger,
    last_whole,
    next_whole,
    repeated,
    rounded,
    signed_like,
    size,
    smaller,
    where,
    widened,
    with_lane,
)
from atra.exact.sums_kernels import UNIT
from atra.raster.clusters import CLUSTER, POINT_BYTES, VERTICES
from atra.raster.culling import TILE, tile_stride
from atra.raster.image import GENTLE, NARROW, SPAN
from atra.raster.nearer import UNSURE

BATCH = 8
"""Triangles set up at once."""

_NOTHING = 1e-60
"""Pixel positions below are 0, so that no product of exact decisions leaves float64."""

_UNIT32 = 2.0**-24

_SMALLEST, _LARGEST = 1e-35, 1e35
"""Float32 between these has all its digits."""

_SURE = 4.0 * UNIT
"""As in `edges_kernels`: the area is the same sum of products."""

NEAR_AND_FAR = 1e3
"""Times that the nearest corner is as near as the farthest, up to which the plane through the three projected corners
is known well enough, and cannot hold the eye. Beyond, it is computed from the corners in space."""

_ROUNDINGS = 10
"""Roundings of the sum that says how far inside a sample lies; each row adds one."""

BLOCK_ROWS = 2
"""Rows that may be drawn at once, a divisor of those of a band: the first may lie above a triangle, the last below."""

_ASIDE = 5.0
"""Times the least depth that a row of parallel rays may begin deeper than the deepest corner: a gentle slope adds twice
that along a row, and as much from the row's samples to its begin."""

LIST_ROOM = CLUSTER + BATCH
"""Triangles of a list, `Clusters.corners` of each: a cluster's, and a batch more."""

NEARNESS, SLOPE_Y = 0, 1
"""Places in a set-up of what is float64, in units of a batch: nearness in the first row and column, and from row to
row."""

LEFT, RIGHT, FIRST, LAST, SLOPE_X, CAP, ROUNDING, INSIDE, ROW, COLUMN = 0, 1, 2, 3, 4, 5, 6, 7, 10, 13
"""Places of what is float32: first and last column, first and last row, nearness from column to column and that of the
nearest corner, up to what sums and differences of nearness are in doubt, and for each edge how far inside of it the
first sample lies, and what the next row and the next column add to that, in units that make both doubts equal."""

DOUBLES, FLOATS = 3, 16


@njit
def project_vertices(parallel, vertices, stride, count, eye, points):  # type: ignore[no-untyped-def]
    """Write `count` vertices, and what follows to the next of VERTICES, to the address `points`, as of
    `store_points`: x, y in pixels, nearness. vertices: address of their x, of float32; those of y and z follow `stride`
    numbers on. Returns whether all `count` are in front of the eye plane.

    Nearness is 1 / depth, or -depth where rays are parallel: linear across the image either way, and the larger, the
    nearer. What lies in the eye plane counts as behind it: no ray meets it.
    """
    m, axis, position = doubles_at(eye.to_pixels), doubles_at(eye.depth_axis), doubles_at(eye.position)
    nothing, tiny, one = repeated(0.0, VERTICES), repeated(_NOTHING, VERTICES), repeated(1.0, VERTICES)
    least, farthest = repeated(eye.least_depth, VERTICES), repeated(np.inf, VERTICES)
    last = farthest
    for vertex in range(0, count, VERTICES):
        place = vertices + vertex * 4
        u = widened(load(place, np.float32(0.0), VERTICES)) - repeated(position[0], VERTICES)
        v = widened(load(place + stride * 4, np.float32(0.0), VERTICES)) - repeated(position[1], VERTICES)
        w = widened(load(place + stride * 8, np.float32(0.0), VERTICES)) - repeated(position[2], VERTICES)
        x = repeated(m[0], VERTICES) * u + repeated(m[1], VERTICES) * v + repeated(m[2], VERTICES) * w
        y = repeated(m[4], VERTICES) * u + repeated(m[5], VERTICES) * v + repeated(m[6], VERTICES) * w
        depth = repeated(axis[0], VERTICES) * u + repeated(axis[1], VERTICES) * v + repeated(axis[2], VERTICES) * w
        if parallel:
            x, y = x + repeated(m[3], VERTICES), y + repeated(m[7], VERTICES)
            nearness = nothing - depth
        else:
            nearness = one / where(size(depth) >= least, depth, where(depth > nothing, least, nothing - least))
            x, y = x * nearness, y * nearness
        x, y = where(size(x) >= tiny, x, nothing), where(size(y) >= tiny, y, nothing)
        store_points(x, y, nearness, points + vertex * POINT_BYTES)
        farthest, last = smaller(farthest, last), nearness
    beyond = -1 << (1 + (count - 1) % VERTICES)
    return bits_of(farthest > nothing) & (bits_of(last > nothing) | beyond) == (1 << VERTICES) - 1


@njit(forceinline=True)
def corner_at(points, packed, corner):  # type: ignore[no-untyped-def]
    """(x, y, nearness) of a triangle's corner."""
    point = doubles_at(points + ((packed >> (16 * corner)) & 0xFFFF))
    return point[0], point[1], point[2]


@njit(forceinline=True)
def _reach(a, b, c, wa, wb, wc):  # type: ignore[no-untyped-def]
    """(low, high) coordinate of the part in front of the eye of a triangle that reaches behind it.

    w: nearness. From a corner in front it reaches away from where the corner behind is projected to, without end.
    """
    low, high = np.inf, -np.inf
    for p, q, r, wp, wq, wr in ((a, b, c, wa, wb, wc), (b, c, a, wb, wc, wa), (c, a, b, wc, wa, wb)):
        if wp > 0.0:
            low, high = min(low, p), max(high, p)
            if (wq < 0.0 and p > q) or (wr < 0.0 and p > r):
                high = np.inf
            if (wq < 0.0 and p < q) or (wr < 0.0 and p < r):
                low = -np.inf
    return low, high


@njit
def _may_be_seen(points, packed, last_column, top, bottom):  # type: ignore[no-untyped-def]
    """Whether what is in front of the eye of a triangle that reaches behind it may hold a sample of those rows."""
    x0, y0, w0 = corner_at(points, packed, 0)
    x1, y1, w1 = corner_at(points, packed, 1)
    x2, y2, w2 = corner_at(points, packed, 2)
    if not max(w0, w1, w2) > 0.0:
        return False
    low_x, high_x = _reach(x0, x1, x2, w0, w1, w2)
    low_y, high_y = _reach(y0, y1, y2, w0, w1, w2)
    return np.ceil(max(low_x, 0.0)) <= np.floor(min(high_x, last_column)) and np.ceil(max(low_y, top)) <= np.floor(
        min(high_y, bottom)
    )


@njit
def list_triangles(parallel, all_in_front, corners, count, points, width, band, listed):  # type: ignore[no-untyped-def]
    """List those of `count` triangles, by their corners, that may hold a sample of a band; returns how many.

    all_in_front: of `project_vertices`. Places as float32 do: rounding moves none across a sample.
    """
    place = listed
    if parallel or all_in_front:
        zero, last_column = repeated(np.float32(0.0), BATCH), repeated(np.float32(width - 1), BATCH)
        top, bottom = repeated(np.float32(band.top), BATCH), repeated(np.float32(band.bottom), BATCH)
        for start in range(0, count, BATCH):
            here = corners + start * 8
            x0, y0 = places_of(points, here, 0)
            x1, y1 = places_of(points, here, 1)
            x2, y2 = places_of(points, here, 2)
            left = next_whole(larger(smaller(smaller(x0, x1), x2), zero))
            right = last_whole(smaller(larger(larger(x0, x1), x2), last_column))
            first = next_whole(larger(smaller(smaller(y0, y1), y2), top))
            last = last_whole(smaller(larger(larger(y0, y1), y2), bottom))
            are_there = (1 << min(BATCH, count - start)) - 1
            place += store_chosen(bits_of((left <= right) & (first <= last)) & are_there, here, place) * 8
        return (place - listed) >> 3
    triangles = integers_at(corners)
    lowest = with_lane(repeated(0.0, 4), 1, float(band.top))
    highest = with_lane(repeated(width - 1.0, 4), 1, float(band.bottom))
    for k in range(count):
        packed = triangles[k]
        p0 = load(points + (packed & 0xFFFF), 0.0, 4)
        p1 = load(points + (packed >> 16 & 0xFFFF), 0.0, 4)
        p2 = load(points + (packed >> 32 & 0xFFFF), 0.0, 4)
        low, high = smaller(smaller(p0, p1), p2), larger(larger(p0, p1), p2)
        first, last = next_whole(larger(low, lowest)), last_whole(smaller(high, highest))
        is_seen = (bits_of(first <= last) & 3) == 3
        if not lane(low, 2) > 0.0:
            is_seen = _may_be_seen(points, packed, width - 1.0, band.top, band.bottom)
        integers_at(place)[0] = packed  # whatever it is: the next one takes its place if it is not to be listed
        place += 8 * is_seen
    return (place - listed) >> 3


@njit(forceinline=True)
def are_hidden(left, right, first, last, nearest, width, tiles):  # type: ignore[no-untyped-def]
    """The triangles of a batch in up to 2 x 2 tiles that are farther than all that is drawn there.

    left, right, first, last: first and last column and row, counted from the band's first.
    """
    share, stride = repeated(1.0 / TILE, BATCH), repeated(float(tile_stride(width)), BATCH)
    left_tile, right_tile = last_whole(left * share), last_whole(right * share)
    top_tile, bottom_tile = last_whole(first * share), last_whole(last * share)
    upper, lower, one = top_tile * stride, bottom_tile * stride, repeated(1.0, BATCH)
    least_there = smaller(
        smaller(gather_at(tiles, upper + left_tile), gather_at(tiles, upper + right_tile)),
        smaller(gather_at(tiles, lower + left_tile), gather_at(tiles, lower + right_tile)),
    )
    return (least_there > rounded(nearest)) & (one >= right_tile - left_tile) & (one >= bottom_tile - top_tile)


@njit
def set_up(parallel, hides, has_depth, width, number, band, workspace):  # type: ignore[no-untyped-def]
    """Write what drawing a batch of listed triangles, from one number on, starts from; returns two numbers with a bit
    for each: those that may be nearer than what is drawn, and of these the ordinary: narrow, gentle, and wholly in
    front of the eye. The others are drawn by their corners alone.

    hides: a triangle in up to 2 x 2 tiles is hidden if its nearest corner is farther than all that is drawn there;
    otherwise all may be seen. has_depth: nearness is written; otherwise steep triangles are ordinary, too.
    """
    base, doubles, floats = workspace.points, workspace.doubles, workspace.floats
    listed = workspace.listed + number * 8
    x0, y0, w0 = points_of(base, listed, 0)
    x1, y1, w1 = points_of(base, listed, 1)
    x2, y2, w2 = points_of(base, listed, 2)
    nearest, farthest = larger(larger(w0, w1), w2), smaller(smaller(w0, w1), w2)
    low_x, high_x = smaller(smaller(x0, x1), x2), larger(larger(x0, x1), x2)
    low_y, high_y = smaller(smaller(y0, y1), y2), larger(larger(y0, y1), y2)
    zero, one = repeated(0.0, BATCH), repeated(1.0, BATCH)
    last_column, first_row = repeated(width - 1.0, BATCH), repeated(float(band.top), BATCH)
    left = smaller(next_whole(larger(low_x, zero)), last_column)
    right = last_whole(larger(smaller(high_x, last_column), zero))
    last_row = repeated(float(band.bottom), BATCH)
    top = next_whole(larger(low_y, zero))
    first = smaller(larger(top, first_row), last_row)
    last = last_whole(larger(smaller(high_y, last_row), first_row))
    may_be_seen = (1 << BATCH) - 1
    if hides:
        limit = repeated(1.0 - UNSURE if parallel else 1.0 + UNSURE, BATCH) * nearest
        hidden = are_hidden(left, right, first - first_row, last - first_row, limit, width, workspace.tiles)
        if not parallel:
            hidden = hidden & (farthest > zero)
        may_be_seen ^= bits_of(hidden)
        if may_be_seen == 0:
            return 0, 0
    # Edge k lies opposite corner k.
    dx0, dy0, dx1, dy1, dx2, dy2 = x2 - x1, y2 - y1, x0 - x2, y0 - y2, x1 - x0, y1 - y0
    one_way, other_way = dx2 * dy1, dy2 * dx1
    area = other_way - one_way
    # No sum and no summand is larger, from the first row and column to the last of a vector.
    across = high_x - low_x
    largest = (high_y - low_y + repeated(float(BLOCK_ROWS), BATCH)) * (across + across + repeated(float(SPAN), BATCH))
    ordinary = (
        (repeated(float(NARROW), BATCH) > right - left)
        & (repeated(_LARGEST, BATCH) > largest)
        & (size(area) > repeated(_SURE, BATCH) * (size(one_way) + size(other_way)))
    )
    if not parallel:
        ordinary = ordinary & (repeated(NEAR_AND_FAR, BATCH) * farthest >= nearest) & (farthest > zero)
    if has_depth:
        inverse, nearer1, nearer2 = one / area, w1 - w0, w2 - w0
        slope_x = zero - (nearer2 * dy2 + nearer1 * dy1) * inverse
        slope_y = (nearer2 * dx2 + nearer1 * dx1) * inverse
        least = zero - nearest if parallel else farthest
        ordinary = ordinary & (repeated(GENTLE, BATCH) * least >= size(slope_x) * repeated(float(NARROW), BATCH))
        store(
            w0 + slope_x * (left - x0) + slope_y * (top - y0) + slope_y * (first - top), doubles + NEARNESS * BATCH * 8
        )
        store(slope_y, doubles + SLOPE_Y * BATCH * 8)
        store_rounded(slope_x, floats, SLOPE_X)
    roundings = (last - first + repeated(float(_ROUNDINGS), BATCH)) * repeated(_UNIT32, BATCH)
    unit, doubt = one, roundings * largest + repeated(_SMALLEST, BATCH)
    if has_depth:
        deepest = repeated(_ASIDE, BATCH) * least - farthest if parallel else nearest
        ordinary = ordinary & (deepest > repeated(_SMALLEST, BATCH))
        unsure = repeated(UNSURE, BATCH) * deepest
        unit, doubt = unsure / doubt, unsure
    facing = signed_like(unit, area)
    store_rounded(left, floats, LEFT)
    store_rounded(right, floats, RIGHT)
    store_rounded(first, floats, FIRST)
    store_rounded(last, floats, LAST)
    store_rounded(nearest, floats, CAP)
    store_rounded(doubt, floats, ROUNDING)
    dx0, dx1, dx2 = facing * dx0, facing * dx1, facing * dx2
    dy0, dy1, dy2 = facing * dy0, facing * dy1, facing * dy2
    store_rounded(dx0 * (first - y1) - dy0 * (left - x1), floats, INSIDE)
    store_rounded(dx1 * (first - y2) - dy1 * (left - x2), floats, INSIDE + 1)
    store_rounded(dx2 * (first - y0) - dy2 * (left - x0), floats, INSIDE + 2)
    store_rounded(dx0, floats, ROW)
    store_rounded(dx1, floats, ROW + 1)
    store_rounded(dx2, floats, ROW + 2)
    store_rounded(zero - dy0, floats, COLUMN)
    store_rounded(zero - dy1, floats, COLUMN + 1)
    store_rounded(zero - dy2, floats, COLUMN + 2)
    return may_be_seen, bits_of(ordinary)


@njit(forceinline=True)
def store_rounded(numbers, floats, place):  # type: ignore[no-untyped-def]
    store(rounded(numbers), floats + place * BATCH * 4)
