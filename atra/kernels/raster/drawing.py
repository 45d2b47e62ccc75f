"""Drawing: band after band of the image, and in it the ordinary triangle, at most a span wide, one vector a row."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add
from atra.kernels.raster.exact import UNIT
from atra.kernels.raster.image import GENTLE, NARROW, SPAN, Band, band_stride
from atra.kernels.raster.narrow import draw_narrow
from atra.kernels.raster.spans import draw_spans
from atra.kernels.raster.vectors import (
    fetch,
    load,
    repeated,
    store,
)
from atra.prim_ids import MISS

_UNIT32 = 2.0**-24

_SMALLEST, _LARGEST = 1e-35, 1e35
"""Float32 between these has all its digits."""

AHEAD = 8
"""Triangles drawn before one whose corners are asked for."""

_SURE = 4.0 * UNIT
"""As in `exact`: the area is the same sum of products."""

_NEAR_AND_FAR = 1e3
"""Times that the nearest corner is as near as the farthest, up to which the plane through the three projected corners
is known well enough. Beyond, it is computed from the corners in space."""


@njit
def _finish(lanes, parallel, band, image):  # type: ignore[no-untyped-def]
    """Write the rows of a band to the image, nearness as depth."""
    nothing, one = repeated(np.float32(0.0), lanes), repeated(np.float32(1.0), lanes)
    whole = image.width // lanes * lanes
    for y in range(band.top, band.bottom + 1):
        source, target = (y - band.top) * band.stride * 4, y * image.width * 4
        for x in range(0, whole, lanes):
            found = load(band.nearness + source + x * 4, np.float32(0.0), lanes)
            store(nothing - found if parallel else one / found, image.depth + target + x * 4)
            store(load(band.prim_id + source + x * 4, np.uint32(0), lanes), image.prim_id + target + x * 4)
        for x in range(whole, image.width):
            found = load(band.nearness + source + x * 4, np.float32(0.0), 1)
            depth = repeated(np.float32(0.0), 1) - found if parallel else repeated(np.float32(1.0), 1) / found
            store(depth, image.depth + target + x * 4)
            store(load(band.prim_id + source + x * 4, np.uint32(0), 1), image.prim_id + target + x * 4)


@cache
def drawing_kernel(lanes: int, parallel: bool) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes, both constants of the compiled code."""
    half = max(lanes // 2, 4)

    @kernel
    def draw_bands(counter_address, view, points, faces, starts, entries, band_rows, image, workspace):  # type: ignore[no-untyped-def]
        """Draw all bands, until the shared counter runs past the last.

        points: of `project`. starts, entries: the triangles of each band. image: written completely.
        Whether a sample lies in a triangle is decided exactly. Three float32 sums say how far it lies inside of the
        edges; the few that are within their rounding of one are decided by `side`.
        """
        stride = band_stride(image.width)
        address = workspace.band
        nothing = repeated(np.float32(-np.inf if parallel else 0.0), lanes)
        none = repeated(np.uint32(MISS), lanes)
        while True:
            number = fetch_add(counter_address, 1)
            if number >= len(starts) - 1:
                return
            band = Band(
                address,
                address + band_rows * stride * 4,
                stride,
                number * band_rows,
                min((number + 1) * band_rows, image.height) - 1,
            )
            for place in range(0, (band.bottom + 1 - band.top) * stride * 4, lanes * 4):
                store(nothing, band.nearness + place)
                store(none, band.prim_id + place)
            end_of_band = starts[number + 1]
            for entry in range(starts[number], end_of_band):
                if entry + AHEAD < end_of_band:
                    later = entries[entry + AHEAD]
                    for corner in range(3):
                        fetch(points.ctypes.data + np.int64(faces[later, corner]) * 32)
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
                dx1, dy1, dx2, dy2 = x0 - x2, y0 - y2, x1 - x0, y1 - y0
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
                    right - left < NARROW
                    and largest < _LARGEST
                    and abs(slope_x) * NARROW <= GENTLE * least
                    and (parallel or nearest <= _NEAR_AND_FAR * farthest)
                    and abs(area) > _SURE * (abs(one_way) + abs(other_way))
                ):
                    first, last = band.top, band.bottom
                    if parallel or farthest > 0.0:
                        first, last = max(int(top), first), min(int(bottom), last)
                    draw_spans(
                        lanes, parallel, view, points, v0, v1, v2, triangle, first, last, image.width, band, workspace
                    )
                    continue
                at_corner = w0 + slope_x * (left - x0) + slope_y * (top - y0)
                first, last = max(int(top), band.top), min(int(bottom), band.bottom)
                rounding = np.float32((last - first + 8) * _UNIT32 * largest + _SMALLEST)
                start, end = int(left), int(right)
                nearness = at_corner + slope_y * (first - top)
                if end - start < half:
                    draw_narrow(
                        half, parallel, triangle, x0, y0, x1, y1, x2, y2, facing, rounding, nearness, slope_x, slope_y,
                        start, end, first, last, band, workspace,
                    )  # fmt: skip
                else:
                    draw_narrow(
                        lanes, parallel, triangle, x0, y0, x1, y1, x2, y2, facing, rounding, nearness, slope_x, slope_y,
                        start, end, first, last, band, workspace,
                    )  # fmt: skip
            _finish(lanes, parallel, band, image)

    return draw_bands
