"""Drawing: band after band of the image, and in it the ordinary triangle, at most a span wide, one vector a row."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.hits import MISS
from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add
from atra.kernels.raster.exact import SUMMANDS, UNIT, side
from atra.kernels.raster.image import GENTLE, SPAN
from atra.kernels.raster.spans import span_function
from atra.kernels.raster.vectors import (
    bits_of,
    counted,
    load,
    mask_of,
    rarely,
    repeated,
    smaller,
    store,
    store_where,
)

_UNIT32 = 2.0**-24

_SMALLEST, _LARGEST = 1e-35, 1e35
"""Float32 between these has all its digits."""

_SURE = 4.0 * UNIT
"""As in `exact`: the area is the same sum of products."""

_NEAR_AND_FAR = 1e3
"""Times that the nearest corner is as near as the farthest, up to which the plane through the three projected corners
is known well enough. Beyond, it is computed from the corners in space."""


@njit
def _decided(points, v0, v1, v2, facing, left, j, lanes, sum_):  # type: ignore[no-untyped-def]
    """Bits of the samples of row j from column `left` on that lie in the triangle, exactly."""
    x0, y0, x1, y1, x2, y2 = points[v0, 0], points[v0, 1], points[v1, 0], points[v1, 1], points[v2, 0], points[v2, 1]
    bits = 0
    for lane in range(lanes):
        i = float(left + lane)
        if (
            side(x0, y0, x1, y1, i, j, sum_) == facing
            and side(x1, y1, x2, y2, i, j, sum_) == facing
            and side(x2, y2, x0, y0, i, j, sum_) == facing
        ):
            bits |= 1 << lane
    return bits


@cache
def drawing_kernel(lanes: int, parallel: bool) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes, both constants of the compiled code."""
    draw_spans = span_function(lanes, parallel)

    @kernel
    def draw_bands(counter_address, view, points, faces, starts, entries, band_rows, image):  # type: ignore[no-untyped-def]
        """Draw all bands, until the shared counter runs past the last.

        points: of `project`. starts, entries: the triangles of each band. image: written completely.
        Whether a sample lies in a triangle is decided exactly. Three float32 sums say how far it lies inside of the
        edges; the few that are within their rounding of one are decided by `side`.
        """
        sum_ = np.empty(SUMMANDS)
        nothing = repeated(np.float32(-np.inf if parallel else 0.0), lanes)
        none = repeated(np.uint32(MISS), lanes)
        one, at_eye = repeated(np.float32(1.0), lanes), repeated(np.float32(0.0), lanes)
        while True:
            band = fetch_add(counter_address, 1)
            if band >= len(starts) - 1:
                return
            band_top, band_bottom = band * band_rows, min((band + 1) * band_rows, image.height) - 1
            first_byte, last_byte = band_top * image.stride * 4, (band_bottom + 1) * image.stride * 4
            for byte in range(first_byte, last_byte, 4 * lanes):
                store(nothing, image.nearness + byte)
                store(none, image.prim_id + byte)
            for entry in range(starts[band], starts[band + 1]):
                triangle = entries[entry]
                v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
                x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
                x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
                x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
                nearest, farthest = max(w0, w1, w2), min(w0, w1, w2)
                low_x, high_x, low_y, high_y = min(x0, x1, x2), max(x0, x1, x2), min(y0, y1, y2), max(y0, y1, y2)
                left, right = max(np.ceil(low_x), 0.0), min(np.floor(high_x), image.width - 1.0)
                top, bottom = max(np.ceil(low_y), 0.0), min(np.floor(high_y), image.height - 1.0)
                # Edge k lies opposite corner k.
                dx0, dy0, dx1, dy1, dx2, dy2 = x2 - x1, y2 - y1, x0 - x2, y0 - y2, x1 - x0, y1 - y0
                one_way, other_way = dx2 * dy1, dy2 * dx1
                area = other_way - one_way
                facing = 1.0 if area > 0.0 else -1.0
                inverse = 1.0 / area if area != 0.0 else np.inf
                slope_x = -((w2 - w0) * dy2 + (w1 - w0) * dy1) * inverse
                slope_y = ((w2 - w0) * dx2 + (w1 - w0) * dx1) * inverse
                least = -nearest if parallel else farthest
                # No sum and no summand is larger, from the first row and column to the last of a vector.
                largest = (high_y - low_y) * (2.0 * (high_x - low_x) + SPAN)
                if not (
                    right - left < SPAN
                    and largest < _LARGEST
                    and abs(slope_x) * SPAN <= GENTLE * least
                    and (parallel or nearest <= _NEAR_AND_FAR * farthest)
                    and abs(area) > _SURE * (abs(one_way) + abs(other_way))
                ):
                    first = band_top if not parallel and farthest < 0.0 else max(int(top), band_top)
                    last = band_bottom if not parallel and farthest < 0.0 else min(int(bottom), band_bottom)
                    draw_spans(view, points, v0, v1, v2, triangle, first, last, image, sum_)
                    continue
                at_corner = w0 + slope_x * (left - x0) + slope_y * (top - y0)
                first, last = max(int(top), band_top), min(int(bottom), band_bottom)
                prim_id = repeated(np.uint32(triangle), lanes)
                rounding = np.float32((last - first + 8) * _UNIT32 * largest + _SMALLEST)
                surely, hardly = repeated(rounding, lanes), repeated(-rounding, lanes)
                j = float(first)
                row0 = repeated(np.float32(facing * dx0), lanes)
                row1 = repeated(np.float32(facing * dx1), lanes)
                row2 = repeated(np.float32(facing * dx2), lanes)
                column0 = repeated(np.float32(-facing * dy0), lanes)
                column1 = repeated(np.float32(-facing * dy1), lanes)
                column2 = repeated(np.float32(-facing * dy2), lanes)
                slope = repeated(np.float32(slope_x), lanes)
                for start in range(int(left), int(right) + 1, lanes):
                    start = min(start, image.stride - lanes)
                    columns = counted(np.float32(0.0), lanes)
                    inside0 = repeated(np.float32(facing * (dx0 * (j - y1) - dy0 * (start - x1))), lanes)
                    inside1 = repeated(np.float32(facing * (dx1 * (j - y2) - dy1 * (start - x2))), lanes)
                    inside2 = repeated(np.float32(facing * (dx2 * (j - y0) - dy2 * (start - x0))), lanes)
                    inside0 = inside0 + columns * column0
                    inside1 = inside1 + columns * column1
                    inside2 = inside2 + columns * column2
                    nearness = counted(np.float32(start - left), lanes) * slope
                    byte = (first * image.stride + start) * 4
                    for y in range(first, last + 1):
                        least_inside = smaller(smaller(inside0, inside1), inside2)
                        found = repeated(np.float32(at_corner + slope_y * (y - top)), lanes) + nearness
                        old = load(image.nearness + byte, np.float32(0.0), lanes)
                        drawn = (least_inside > hardly) & (found > old)
                        if parallel:
                            drawn = drawn & (at_eye > found)
                        if rarely(bits_of(drawn & (least_inside <= surely)) != 0):
                            exactly = _decided(points, v0, v1, v2, int(facing), start, float(y), lanes, sum_)
                            drawn = drawn & mask_of(exactly, lanes)
                        store_where(drawn, found, image.nearness + byte)
                        store_where(drawn, prim_id, image.prim_id + byte)
                        inside0, inside1, inside2 = inside0 + row0, inside1 + row1, inside2 + row2
                        byte += image.stride * 4
            for byte in range(first_byte, last_byte, 4 * lanes):
                found = load(image.nearness + byte, np.float32(0.0), lanes)
                store(at_eye - found if parallel else one / found, image.nearness + byte)

    return draw_bands
