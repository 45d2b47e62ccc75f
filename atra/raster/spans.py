"""Spans: any triangle, row by row, from its first sample to its last; wide ones, and whatever is not quite ordinary."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.memory import doubles_at, load, store, store_where
from atra.compiled.store import njit
from atra.compiled.vectors import (
    arange,
    bits_of,
    ceil,
    larger,
    mask_of,
    nearest_whole,
    rarely,
    rounded,
    smaller,
    splat,
    where,
)
from atra.exact.edges_kernels import SURELY_NEAREST, crossing_error, first_beyond, turn
from atra.raster.corners import parallel_plane, plane_in_space
from atra.raster.culling import is_hidden
from atra.raster.image import GENTLE, SPAN
from atra.raster.nearer import FEW, UNSURE, nearness_along, without_farther
from atra.raster.triangles import corner_at

ROWS = 8
"""Rows whose spans are found at once."""


@njit
def _cut(px, py, qx, qy, is_left, top, count, width, memory):  # type: ignore[no-untyped-def]
    """Cut the rows top, top + 1, ... off at an edge: before its first sample beyond, or from there on."""
    address = memory.first if is_left else memory.last
    limits = doubles_at(address)
    ax, ay = (px, py) if abs(px) + abs(py) < abs(qx) + abs(qy) else (qx, qy)  # the nearer corner errs less
    slope = (qx - px) / (qy - py)
    error = crossing_error(ax, slope * max(abs(top - ay), abs(top + count - ay)))
    is_known = error < SURELY_NEAREST
    slopes, first_x, first_y = splat(slope, ROWS), splat(ax, ROWS), splat(ay, ROWS)
    lowest, highest, unsure = splat(-0.5, ROWS), splat(width + 0.5, ROWS), splat(error, ROWS)
    one = splat(1.0, ROWS)
    for k in range(0, count, ROWS):
        crossing = (arange(float(top + k), ROWS) - first_y) * slopes + first_x
        crossing = smaller(larger(crossing, lowest), highest)
        beyond = ceil(crossing)
        place = address + k * 8
        old = load(place, 0.0, ROWS)
        store(larger(old, beyond) if is_left else smaller(old, beyond - one), place)
        undecided = bits_of(abs(crossing - nearest_whole(crossing)) <= unsure)
        if rarely(undecided != 0 or not is_known):
            store(old, place)
            for row in range(k, min(k + ROWS, count)):
                exactly = first_beyond(px, py, qx, qy, float(top + row), width, memory.exact)
                limits[row] = max(limits[row], exactly) if is_left else min(limits[row], exactly - 1)


class Spans(NamedTuple):
    """Which way a triangle turns on the image, 0 if it is not seen; its first and last row in a band; and nearness:
    slope_x i + slope_y j + constant, from the farthest to the nearest, gentle or not (`GENTLE`)."""

    facing: int
    top: int
    bottom: int
    slope_x: float
    slope_y: float
    constant: float
    farthest: float
    nearest: float
    is_gentle: bool


@njit
def rows_met(parallel, packed, band, points):  # type: ignore[no-untyped-def]
    """First and last row of a band that may hold a sample of a triangle."""
    _, y0, w0 = corner_at(points, packed, 0)
    _, y1, w1 = corner_at(points, packed, 1)
    _, y2, w2 = corner_at(points, packed, 2)
    if parallel or min(w0, w1, w2) > 0.0:
        return int(max(np.ceil(min(y0, y1, y2)), band.top)), int(min(np.floor(max(y0, y1, y2)), band.bottom))
    return band.top, band.bottom


@njit
def find_spans(parallel, eye, vertices, vertex_count, packed, width, band, memory):  # type: ignore[no-untyped-def]
    """The `Spans` of a triangle with these corners, of a cluster with the vertices from an address on; where each of
    its rows starts and ends is written to the memory.

    A corner behind the eye is projected to where its line through the eye meets the image, and turns the side of
    its edges that counts, each corner once; otherwise nothing is different for it.
    """
    points = memory.points
    x0, y0, w0 = corner_at(points, packed, 0)
    x1, y1, w1 = corner_at(points, packed, 1)
    x2, y2, w2 = corner_at(points, packed, 2)
    top, bottom = rows_met(parallel, packed, band, points)
    nearest, farthest = max(w0, w1, w2), min(w0, w1, w2)
    facing = turn(x0, y0, x1, y1, x2, y2, memory.exact) if top <= bottom else 0
    slope_x = slope_y = constant = least = 0.0
    if parallel:
        slope_x, slope_y, constant = parallel_plane(x0, y0, w0, x1, y1, w1, x2, y2, w2)
        least = -nearest
    else:
        slope_x, slope_y, constant, nearest, farthest, is_seen = plane_in_space(
            eye, vertices, vertex_count, packed, points, nearest, farthest
        )
        facing = facing if is_seen else 0
        least = farthest
    is_gentle = abs(slope_x) * SPAN <= GENTLE * least
    if facing != 0:
        firsts, lasts = doubles_at(memory.first), doubles_at(memory.last)
        for k in range(bottom - top + 1):
            firsts[k], lasts[k] = 0.0, width - 1.0
        for px, py, qx, qy, wanted in (
            (x1, y1, x2, y2, -facing if not parallel and w0 < 0.0 else facing),
            (x2, y2, x0, y0, -facing if not parallel and w1 < 0.0 else facing),
            (x0, y0, x1, y1, -facing if not parallel and w2 < 0.0 else facing),
        ):
            if qy != py:
                _cut(px, py, qx, qy, (qy > py) == (wanted < 0), top, bottom - top + 1, width, memory)
            else:
                for k in range(bottom - top + 1):
                    if qx == px or wanted != (1 if (qx > px) == (top + k >= py) else -1):
                        lasts[k] = -1.0
    return Spans(facing, top, bottom, slope_x, slope_y, constant, farthest, nearest, is_gentle)


@njit(forceinline=True)
def nearness_of(parallel, lanes, found, row, start):  # type: ignore[no-untyped-def]
    """Nearness, float32, from column `start` on. found: `Spans`. row: nearness in column 0 of the row."""
    if found.is_gentle:
        base = start // SPAN * SPAN
        first = splat(np.float32(row + found.slope_x * base), lanes)
        along = arange(np.float32(start - base), lanes) * splat(np.float32(found.slope_x), lanes)
        return smaller(splat(np.float32(found.nearest), lanes), first + along)
    wide = splat(row, lanes) + arange(float(start), lanes) * splat(found.slope_x, lanes)
    if not parallel:
        wide = abs(wide)  # the sign is wrong where the eye is in the plane but for rounding
    return rounded(smaller(larger(wide, splat(found.farthest, lanes)), splat(found.nearest, lanes)))


@njit(forceinline=True)
def _draw_row(lanes, parallel, prim_ids, rounding, spans, row, y, first, last, band):  # type: ignore[no-untyped-def]
    """Draw the row y of a triangle, from `first` to `last`, where it is surely nearer than what is drawn; returns
    whether a sample is undecided. rounding: difference of nearness up to which it is. row: nearness in column 0."""
    zero, nowhere = splat(np.float32(0.0), lanes), splat(np.float32(-np.inf), lanes)
    before, end = splat(np.float32(first - 1), lanes), splat(np.float32(last), lanes)
    columns, next_columns = arange(np.float32(first // lanes * lanes), lanes), splat(np.float32(lanes), lanes)
    byte, least = (y - band.top) * band.stride * 4, splat(np.float32(np.inf), lanes)
    for start in range(first // lanes * lanes, last + 1, lanes):
        place = byte + start * 4
        found = nearness_of(parallel, lanes, spans, row, start)
        ahead = found - load(band.nearness + place, np.float32(0.0), lanes)
        if parallel:  # nothing is drawn that is not before the eye
            ahead = smaller(ahead, zero - found)
        ahead = where((columns > before) & (columns <= end), ahead, nowhere)
        store_where(ahead > rounding, found, band.nearness + place)
        store_where(ahead > rounding, prim_ids, band.prim_id + place)
        least = smaller(least, abs(ahead))
        columns = columns + next_columns
    return bits_of(least <= rounding) != 0


@njit
def _decide_row(lanes, parallel, eye, clusters, prim_id, unsure, spans, row, y, first, last, band):  # type: ignore[no-untyped-def]
    """Draw the samples that `_draw_row` left undecided. unsure: its rounding. Among its vectors, a call of what decides
    would have them kept in memory."""
    rounding, less, at_eye = splat(unsure, lanes), splat(-unsure, lanes), splat(np.float32(0.0), lanes)
    prim_ids, byte = splat(prim_id, lanes), (y - band.top) * band.stride * 4
    before, end = splat(np.float32(first - 1), lanes), splat(np.float32(last), lanes)
    own = stored = nearness_along(parallel, eye, clusters, prim_id, y)
    known = prim_id
    for start in range(first // lanes * lanes, last + 1, lanes):
        place, columns = byte + start * 4, arange(np.float32(start), lanes)
        found, ids = nearness_of(parallel, lanes, spans, row, start), band.prim_id + place
        ahead = found - load(band.nearness + place, np.float32(0.0), lanes)
        left = (load(ids, np.uint32(0), lanes) != prim_ids) & (columns > before) & (columns <= end) & (ahead >= less)
        if parallel:
            left = left & (at_eye > found)
        bits = bits_of(left)
        if bits != 0:
            close = bits & bits_of(ahead <= rounding)
            bits, known, stored = without_farther(
                parallel, bits, close, prim_id, own, known, stored, ids, eye, clusters, start, y
            )
            store_where(mask_of(bits, lanes), found, band.nearness + place)
            store_where(mask_of(bits, lanes), prim_ids, ids)


@njit
def draw_spans(lanes, parallel, eye, clusters, vertices, vertex_count, prim_id, packed, width, band, memory):  # type: ignore[no-untyped-def]
    """Draw a triangle with these corners, of a cluster with the vertices from an address on, with vectors of `lanes`,
    unless what is drawn hides its box."""
    points = memory.points
    x0, _, w0 = corner_at(points, packed, 0)
    x1, _, w1 = corner_at(points, packed, 1)
    x2, _, w2 = corner_at(points, packed, 2)
    if parallel or min(w0, w1, w2) > 0.0:
        top, bottom = rows_met(parallel, packed, band, points)
        left, right = int(max(np.ceil(min(x0, x1, x2)), 0.0)), int(min(np.floor(max(x0, x1, x2)), width - 1.0))
        limit = np.float32(max(w0, w1, w2) * (1.0 - UNSURE if parallel else 1.0 + UNSURE))
        if is_hidden(left, right, top - band.top, bottom - band.top, limit, width, memory.tiles):
            return
    spans = find_spans(parallel, eye, vertices, vertex_count, packed, width, band, memory)
    if spans.facing == 0:
        return
    firsts, lasts = doubles_at(memory.first), doubles_at(memory.last)
    most = max(abs(spans.nearest), abs(spans.farthest))
    prim_ids, unsure = splat(prim_id, lanes), np.float32(UNSURE * most)
    rounding = splat(unsure, lanes)
    for k in range(spans.bottom - spans.top + 1):
        y, first, last = spans.top + k, int(firsts[k]), int(lasts[k])
        row = spans.slope_y * y + spans.constant
        if most == np.inf:  # it reaches behind the eye
            unsure = np.float32(UNSURE * max(abs(row + spans.slope_x * first), abs(row + spans.slope_x * last)))
            rounding = splat(unsure, lanes)
        if rarely(_draw_row(lanes, parallel, prim_ids, rounding, spans, row, y, first, last, band)):
            _decide_row(FEW, parallel, eye, clusters, prim_id, unsure, spans, row, y, first, last, band)
