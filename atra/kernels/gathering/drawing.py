"""Drawing all hits: band after band of the image, every triangle where it is, whatever is in front of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.gathering.narrow import BLOCK_ROWS, take_narrow
from atra.kernels.gathering.spans import take_spans
from atra.kernels.gathering.taking import LAYERS, THICKNESS, TRANSMITTANCE
from atra.kernels.gathering.target import target_at
from atra.kernels.intrinsics import fetch_add, float_at
from atra.kernels.raster.exact import UNIT
from atra.kernels.raster.image import GENTLE, NARROW, SPAN
from atra.kernels.raster.memory import fetch, store
from atra.kernels.raster.vectors import repeated
from atra.prim_ids import MISS

AHEAD = 8
"""Triangles drawn before one whose corners are asked for."""

_UNIT32 = 2.0**-24

_SMALLEST, _LARGEST = 1e-35, 1e35
"""Float32 between these has all its digits."""

_SURE = 4.0 * UNIT
"""As in `atra.kernels.raster.exact`: the area is the same sum of products."""

_NEAR_AND_FAR = 1e3
"""As in `atra.kernels.raster.drawing`."""


@njit(inline="always")
def _clear(kind, lanes, top, bottom, target):  # type: ignore[no-untyped-def]
    """Set rows top ... bottom to what they are without a hit, where they will be drawn at once."""
    start = np.float32(0.0)
    if kind == TRANSMITTANCE:
        start = np.float32(1.0)
    elif kind == LAYERS:
        start = np.float32(np.inf)
    values, nobody, none = repeated(start, lanes), repeated(np.uint32(MISS), lanes), repeated(np.uint32(0), lanes)
    first, size = top * target.row * 4, (bottom + 1 - top) * target.row * 4
    for layer in range(target.layers):
        place = first + layer * target.plane * 4
        for byte in range(place, place + size, lanes * 4):
            store(values, target.values + byte)
        if kind == LAYERS:
            for byte in range(place, place + size, lanes * 4):
                store(nobody, target.prim_ids + byte)
    if kind == LAYERS:
        for byte in range(first, first + size, lanes * 4):
            store(none, target.counts + byte)


@cache
def gathering_kernel(lanes: int, parallel: bool, kind: int) -> Callable[..., None]:
    """The loop over bands, with vectors of so many lanes; all three are constants of the compiled code."""
    half = max(lanes // 2, 4)
    half_rows = lanes // half
    has_depth, has_factors = kind in (THICKNESS, LAYERS), kind == TRANSMITTANCE

    @kernel
    def gather_bands(counter_address, view, points, faces, starts, entries, band_rows, width, height, workspace, block):  # type: ignore[no-untyped-def]
        """Take the hits of all bands, until the shared counter runs past the last.

        points: of `project`. starts, entries: the triangles of each band. block: of a `Target`; all of its image is
        written. What lies in a triangle is decided as in `atra.kernels.raster.drawing`.
        """
        target = target_at(block)
        while True:
            number = fetch_add(counter_address, 1)
            if number >= len(starts) - 1:
                return
            band_top, band_bottom = number * band_rows, min((number + 1) * band_rows, height) - 1
            _clear(kind, lanes, band_top, band_bottom, target)
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
                left, right = max(np.ceil(low_x), 0.0), min(np.floor(high_x), width - 1.0)
                top, bottom = max(np.ceil(low_y), 0.0), min(np.floor(high_y), height - 1.0)
                # Edge k lies opposite corner k.
                dx1, dy1, dx2, dy2 = x0 - x2, y0 - y2, x1 - x0, y1 - y0
                one_way, other_way = dx2 * dy1, dy2 * dx1
                area = other_way - one_way
                facing = 1.0 if area > 0.0 else -1.0
                slope_x = slope_y = 0.0
                is_gentle = True
                if has_depth:
                    inverse = 1.0 / area if area != 0.0 else np.inf
                    slope_x = -((w2 - w0) * dy2 + (w1 - w0) * dy1) * inverse
                    slope_y = ((w2 - w0) * dx2 + (w1 - w0) * dx1) * inverse
                    least = -nearest if parallel else farthest
                    is_gentle = max(abs(slope_x) * NARROW, abs(slope_y) * BLOCK_ROWS) <= GENTLE * least and (
                        parallel or nearest <= _NEAR_AND_FAR * farthest
                    )
                # No sum and no summand is larger, from the first row and column to the last of a vector.
                largest = (high_y - low_y + BLOCK_ROWS) * (2.0 * (high_x - low_x) + SPAN)
                in_front = nearest < 0.0 if parallel else farthest > 0.0
                weight = float_at(target.weights + np.int64(triangle) * 4) if has_factors else np.float32(facing)
                if not (
                    in_front
                    and right - left < NARROW
                    and largest < _LARGEST
                    and is_gentle
                    and abs(area) > _SURE * (abs(one_way) + abs(other_way))
                ):
                    first, last = band_top, band_bottom
                    if parallel or farthest > 0.0:
                        first, last = max(int(top), first), min(int(bottom), last)
                    take_spans(
                        kind, lanes, parallel, has_depth, has_factors, view, points, v0, v1, v2, weight, triangle,
                        first, last, width, workspace, target,
                    )  # fmt: skip
                    continue
                first, last = max(int(top), band_top), min(int(bottom), band_bottom)
                rounding = np.float32((last - first + 8) * _UNIT32 * largest + _SMALLEST)
                start, end = int(left), int(right)
                if end - start < half:
                    first -= first % half_rows
                    nearness = w0 + slope_x * (left - x0) + slope_y * (first - y0)
                    take_narrow(
                        kind, lanes, half, parallel, has_depth, triangle, weight, x0, y0, x1, y1, x2, y2, facing,
                        rounding, nearness, slope_x, slope_y, start, end, first, last, workspace, target,
                    )  # fmt: skip
                else:
                    nearness = w0 + slope_x * (left - x0) + slope_y * (first - y0)
                    take_narrow(
                        kind, lanes, lanes, parallel, has_depth, triangle, weight, x0, y0, x1, y1, x2, y2, facing,
                        rounding, nearness, slope_x, slope_y, start, end, first, last, workspace, target,
                    )  # fmt: skip

    return gather_bands
