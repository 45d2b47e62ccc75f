"""Triangles of one cluster: its vertices in pixels, and those that may hold a sample."""

from __future__ import annotations

import numpy as np

from atra.compiled.lanes import store_chosen
from atra.compiled.memory import (
    doubles_at,
    integers_at,
    load,
    places_of,
    store_points,
)
from atra.compiled.store import njit
from atra.compiled.vectors import (
    bits_of,
    ceil,
    floor,
    lane,
    larger,
    smaller,
    splat,
    where,
    widened,
    with_lane,
)
from atra.raster.clusters import CLUSTER, POINT_BYTES, VERTICES

BATCH = 8
"""Triangles set up at once."""

_NOTHING = 1e-60
"""Pixel positions below are 0, so that no product of exact decisions leaves float64."""

LIST_ROOM = CLUSTER + BATCH
"""Triangles of a list, `Clusters.corners` of each: a cluster's, and a batch more."""


@njit
def project_vertices(parallel, vertices, stride, count, eye, points):  # type: ignore[no-untyped-def]
    """Write `count` vertices, and what follows to the next of VERTICES, to the address `points`, as of
    `store_points`: x, y in pixels, nearness. vertices: address of their x, of float32; those of y and z follow `stride`
    numbers on. Returns whether all `count` are in front of the eye plane.

    Nearness is 1 / depth, or -depth where rays are parallel: linear across the image either way, and the larger, the
    nearer. What lies in the eye plane counts as behind it: no ray meets it.
    """
    m, axis, position = doubles_at(eye.to_pixels), doubles_at(eye.depth_axis), doubles_at(eye.position)
    nothing, tiny, one = splat(0.0, VERTICES), splat(_NOTHING, VERTICES), splat(1.0, VERTICES)
    least, farthest = splat(eye.least_depth, VERTICES), splat(np.inf, VERTICES)
    last = farthest
    for vertex in range(0, count, VERTICES):
        place = vertices + vertex * 4
        u = widened(load(place, np.float32(0.0), VERTICES)) - splat(position[0], VERTICES)
        v = widened(load(place + stride * 4, np.float32(0.0), VERTICES)) - splat(position[1], VERTICES)
        w = widened(load(place + stride * 8, np.float32(0.0), VERTICES)) - splat(position[2], VERTICES)
        x = splat(m[0], VERTICES) * u + splat(m[1], VERTICES) * v + splat(m[2], VERTICES) * w
        y = splat(m[4], VERTICES) * u + splat(m[5], VERTICES) * v + splat(m[6], VERTICES) * w
        depth = splat(axis[0], VERTICES) * u + splat(axis[1], VERTICES) * v + splat(axis[2], VERTICES) * w
        if parallel:
            x, y = x + splat(m[3], VERTICES), y + splat(m[7], VERTICES)
            nearness = nothing - depth
        else:
            nearness = one / where(abs(depth) >= least, depth, where(depth > nothing, least, nothing - least))
            x, y = x * nearness, y * nearness
        x, y = where(abs(x) >= tiny, x, nothing), where(abs(y) >= tiny, y, nothing)
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
    if not (parallel or all_in_front):
        return list_one_by_one(False, corners, count, points, 0.0, width, band, listed)
    place = listed
    zero, last_column = splat(np.float32(0.0), BATCH), splat(np.float32(width - 1), BATCH)
    top, bottom = splat(np.float32(band.top), BATCH), splat(np.float32(band.bottom), BATCH)
    for start in range(0, count, BATCH):
        here = corners + start * 8
        x0, y0 = places_of(points, here, 0)
        x1, y1 = places_of(points, here, 1)
        x2, y2 = places_of(points, here, 2)
        left = ceil(larger(smaller(smaller(x0, x1), x2), zero))
        right = floor(smaller(larger(larger(x0, x1), x2), last_column))
        first = ceil(larger(smaller(smaller(y0, y1), y2), top))
        last = floor(smaller(larger(larger(y0, y1), y2), bottom))
        are_there = (1 << min(BATCH, count - start)) - 1
        place += store_chosen(bits_of((left <= right) & (first <= last)) & are_there, here, place) * 8
    return (place - listed) >> 3


@njit
def list_one_by_one(lens, corners, count, points, margin, width, band, listed):  # type: ignore[no-untyped-def]
    """As `list_triangles`, where some may reach behind the eye, and samples lie up to `margin` beside whole numbers.

    lens: whether a triangle is listed that reaches behind the eye, wherever it may be seen.
    """
    triangles, place, wider = integers_at(corners), listed, splat(margin, 4)
    lowest = with_lane(splat(0.0, 4), 1, float(band.top))
    highest = with_lane(splat(width - 1.0, 4), 1, float(band.bottom))
    for k in range(count):
        packed = triangles[k]
        p0 = load(points + (packed & 0xFFFF), 0.0, 4)
        p1 = load(points + (packed >> 16 & 0xFFFF), 0.0, 4)
        p2 = load(points + (packed >> 32 & 0xFFFF), 0.0, 4)
        low, high = smaller(smaller(p0, p1), p2), larger(larger(p0, p1), p2)
        first, last = ceil(larger(low - wider, lowest)), floor(smaller(high + wider, highest))
        is_seen = (bits_of(first <= last) & 3) == 3
        if not lane(low, 2) > 0.0:
            is_seen = lane(high, 2) > 0.0 if lens else _may_be_seen(points, packed, width - 1.0, band.top, band.bottom)
        integers_at(place)[0] = packed  # whatever it is: the next one takes its place if it is not to be listed
        place += 8 * is_seen
    return (place - listed) >> 3
