"""Spans: any triangle, row by row, from its first sample to its last; wide ones, and whatever is not quite ordinary."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.kernels.raster.exact import first_beyond, turn
from atra.kernels.raster.image import GENTLE, SPAN
from atra.kernels.raster.vectors import (
    counted,
    larger,
    load,
    repeated,
    rounded,
    smaller,
    store_where,
)


@njit(inline="always")
def _homogeneous(view, vertex):  # type: ignore[no-untyped-def]
    """(x, y, 1) times the depth of a vertex, where x and y are its pixel position; for a pinhole."""
    u, v = view.vertices[vertex, 0] - view.eye[0], view.vertices[vertex, 1] - view.eye[1]
    w, m = view.vertices[vertex, 2] - view.eye[2], view.to_pixels
    return (
        m[0, 0] * u + m[0, 1] * v + m[0, 2] * w,
        m[1, 0] * u + m[1, 1] * v + m[1, 2] * w,
        m[2, 0] * u + m[2, 1] * v + m[2, 2] * w,
    )


@njit(inline="always")
def _divided(a, b):  # type: ignore[no-untyped-def]
    return a / b if b != 0.0 else np.nan


@njit
def _pinhole_plane(view, v0, v1, v2):  # type: ignore[no-untyped-def]
    """Nearness A i + B j + C on the plane of a triangle that may reach behind the eye; NaN where it is edge-on.

    The plane of the corners p0, p1, p2, homogeneous, with normal n = (p1 - p0) x (p2 - p0), is met at 1 / depth =
    n . (i, j, 1) / n . p0.
    """
    a0, b0, c0 = _homogeneous(view, v0)
    a1, b1, c1 = _homogeneous(view, v1)
    a2, b2, c2 = _homogeneous(view, v2)
    a1, b1, c1 = a1 - a0, b1 - b0, c1 - c0
    a2, b2, c2 = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = b1 * c2 - c1 * b2, c1 * a2 - a1 * c2, a1 * b2 - b1 * a2
    inverse = _divided(1.0, na * a0 + nb * b0 + nc * c0)
    return na * inverse, nb * inverse, nc * inverse


@njit
def _parallel_plane(points, v0, v1, v2):  # type: ignore[no-untyped-def]
    """The same where rays are parallel."""
    x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
    x1, y1, w1 = points[v1, 0] - x0, points[v1, 1] - y0, points[v1, 2] - w0
    x2, y2, w2 = points[v2, 0] - x0, points[v2, 1] - y0, points[v2, 2] - w0
    inverse = _divided(1.0, x1 * y2 - y1 * x2)
    a, b = (w1 * y2 - w2 * y1) * inverse, (w2 * x1 - w1 * x2) * inverse
    return a, b, w0 - a * x0 - b * y0


@cache
def span_function(lanes: int, parallel: bool) -> Callable[..., None]:
    """What draws a triangle by spans with vectors of so many lanes, both constants of the compiled code."""

    @njit
    def draw_spans(view, points, v0, v1, v2, triangle, top, bottom, image, sum_):  # type: ignore[no-untyped-def]
        """Draw the rows top ... bottom of a triangle. sum_: as in `turn`.

        A corner behind the eye is projected to where its line through the eye meets the image, and turns the side of
        its edges that counts, each corner once; otherwise nothing is different for it.
        """
        x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
        x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
        x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
        facing = turn(x0, y0, x1, y1, x2, y2, sum_)
        if facing == 0:
            return
        nearest, farthest = max(w0, w1, w2), min(w0, w1, w2)
        if parallel:
            slope_x, slope_y, constant = _parallel_plane(points, v0, v1, v2)
            least = -nearest
        else:
            slope_x, slope_y, constant = _pinhole_plane(view, v0, v1, v2)
            if farthest < 0.0:
                nearest, farthest = np.inf, np.inf
                for w in (w0, w1, w2):
                    farthest = min(farthest, w if w > 0.0 else np.inf)
            least = farthest
        gentle = abs(slope_x) * SPAN <= GENTLE * least
        sides = (
            (x1, y1, x2, y2, -facing if not parallel and w0 < 0.0 else facing),
            (x2, y2, x0, y0, -facing if not parallel and w1 < 0.0 else facing),
            (x0, y0, x1, y1, -facing if not parallel and w2 < 0.0 else facing),
        )
        prim_id = repeated(np.uint32(triangle), lanes)
        step = repeated(np.float32(slope_x), lanes)
        step_wide = repeated(slope_x, lanes)
        low, high = repeated(farthest, lanes), repeated(nearest, lanes)
        at_eye = repeated(np.float32(0.0), lanes)
        for j in range(top, bottom + 1):
            first, last = 0, image.width - 1
            for px, py, qx, qy, wanted in sides:
                if qy == py:
                    beyond = 1 if (qx > px) == (j >= py) else -1
                    if qx == px or beyond != wanted:
                        last = -1
                elif (qy > py) == (wanted < 0):
                    first = max(first, first_beyond(px, py, qx, qy, float(j), image.width, sum_))
                else:
                    last = min(last, first_beyond(px, py, qx, qy, float(j), image.width, sum_) - 1)
            if first > last:
                continue
            row = slope_y * j + constant
            place = image.nearness + (j * image.stride) * 4
            names = image.prim_id + (j * image.stride) * 4
            for start in range(first // lanes * lanes, last + 1, lanes):
                old = load(place + start * 4, np.float32(0.0), lanes)
                if gentle:
                    base = start // SPAN * SPAN
                    found = repeated(np.float32(row + slope_x * base), lanes)
                    found = found + counted(np.float32(start - base), lanes) * step
                else:
                    wide = repeated(row, lanes) + counted(float(start), lanes) * step_wide
                    found = rounded(smaller(larger(wide, low), high))
                columns = counted(np.float32(start), lanes)
                drawn = (found > old) & (columns > repeated(np.float32(first - 1), lanes))
                drawn = drawn & (columns <= repeated(np.float32(last), lanes))
                if parallel:
                    drawn = drawn & (at_eye > found)
                store_where(drawn, found, place + start * 4)
                store_where(drawn, prim_id, names + start * 4)

    return draw_spans
