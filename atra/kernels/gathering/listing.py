"""Lists: the vertices in pixels, and for each band of rows the triangles that may be seen there.

A band is so many rows that its part of the image stays in the cache while its triangles are drawn one after another;
threads take band after band. Triangles are counted per chunk of them and band, and then put in their places, so that a
band's are in ascending order whoever listed them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add
from atra.kernels.raster.memory import load
from atra.kernels.raster.vectors import lane, larger, last_whole, next_whole, smaller

CHUNK = 4096
"""Vertices, or triangles, a thread takes at a time."""

_NOTHING = 1e-60
"""Pixel positions below are 0, so that no product of exact decisions leaves float64."""


@kernel
def project(counter_address, vertices, eye, to_pixels, depth_axis, least_depth, points):  # type: ignore[no-untyped-def]
    """World points (V, 3) float32 -> (V, 4) float64: x, y in pixels, nearness; the last is left alone.

    to_pixels: (3, 4) float64, of homogeneous eye space. depth_axis: (3,) float64, the view axis in eye space. Nearness
    is 1 / depth, or -depth where rays are parallel: linear across the image either way, and the larger, the nearer.
    least_depth: what smaller depths count as, on either side of the eye plane; 0 where rays are parallel. What lies in
    the eye plane counts as behind it: no ray meets it.
    """
    m = to_pixels
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(vertices):
            return
        for point in range(start, min(start + CHUNK, len(vertices))):
            u, v, w = vertices[point, 0] - eye[0], vertices[point, 1] - eye[1], vertices[point, 2] - eye[2]
            x = m[0, 0] * u + m[0, 1] * v + m[0, 2] * w + m[0, 3]
            y = m[1, 0] * u + m[1, 1] * v + m[1, 2] * w + m[1, 3]
            depth = depth_axis[0] * u + depth_axis[1] * v + depth_axis[2] * w
            nearness = -depth
            if least_depth > 0.0:
                if abs(depth) < least_depth:
                    depth = least_depth if depth > 0.0 else -least_depth
                nearness = 1.0 / depth
                x, y = x * nearness, y * nearness
            points[point, 0] = x if abs(x) >= _NOTHING else 0.0
            points[point, 1] = y if abs(y) >= _NOTHING else 0.0
            points[point, 2] = nearness


@njit(inline="always")
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
def _reaching(points, v0, v1, v2):  # type: ignore[no-untyped-def]
    """Lowest and highest x and y, pixels, of what is in front of the eye of a triangle that reaches behind it."""
    w0, w1, w2 = points[v0, 2], points[v1, 2], points[v2, 2]
    low_x, high_x = _reach(points[v0, 0], points[v1, 0], points[v2, 0], w0, w1, w2)
    low_y, high_y = _reach(points[v0, 1], points[v1, 1], points[v2, 1], w0, w1, w2)
    return low_x, high_x, low_y, high_y


@kernel
def list_triangles(  # type: ignore[no-untyped-def]
    counter_address, points, faces, parallel, width, height, band_rows, listed, bands, counts
):  # fmt: skip
    """The triangles that may hold a sample: listed (F,) uint32, from the first place of each chunk on; bands (F, 2)
    int32, their first and last band; counts (chunks, bands + 1) int64, so many in each band and, last, in the chunk.

    Nothing branches on what is common: a triangle that is not to be listed is written, and the next one in its place.
    """
    band_count = counts.shape[1] - 1
    base, to_band = points.ctypes.data, 1.0 / band_rows
    last_x, last_y = width - 1.0, height - 1.0
    while True:
        chunk = fetch_add(counter_address, 1)
        start = chunk * CHUNK
        if start >= len(faces):
            return
        place = start
        for band in range(band_count + 1):
            counts[chunk, band] = 0
        for triangle in range(start, min(start + CHUNK, len(faces))):
            v0, v1, v2 = np.int64(faces[triangle, 0]), np.int64(faces[triangle, 1]), np.int64(faces[triangle, 2])
            p0, p1, p2 = load(base + v0 * 32, 0.0, 4), load(base + v1 * 32, 0.0, 4), load(base + v2 * 32, 0.0, 4)
            low, high = smaller(smaller(p0, p1), p2), larger(larger(p0, p1), p2)
            first, last = next_whole(low), last_whole(high)
            left, right, top, bottom = lane(first, 0), lane(last, 0), lane(first, 1), lane(last, 1)
            if parallel:
                in_front = lane(low, 2) < 0.0
            else:
                in_front = lane(high, 2) > 0.0
                if in_front and not lane(low, 2) > 0.0:
                    low_x, high_x, low_y, high_y = _reaching(points, v0, v1, v2)
                    left, right, top, bottom = np.ceil(low_x), np.floor(high_x), np.ceil(low_y), np.floor(high_y)
            left, right, top, bottom = max(left, 0.0), min(right, last_x), max(top, 0.0), min(bottom, last_y)
            is_seen = in_front & (left <= right) & (top <= bottom)
            first_band, last_band = int(min(top, last_y) * to_band), int(max(bottom, 0.0) * to_band)
            listed[place], bands[place, 0], bands[place, 1] = triangle, first_band, last_band
            place += is_seen
            counts[chunk, first_band] += is_seen
            if is_seen and last_band > first_band:
                for band in range(first_band + 1, last_band + 1):
                    counts[chunk, band] += 1
        counts[chunk, band_count] = place - start


@kernel
def place_bands(counts, starts):  # type: ignore[no-untyped-def]
    """Counts become places: where each chunk's part of a band starts. starts: (bands + 1,) int64, where bands do."""
    place = 0
    for band in range(counts.shape[1] - 1):
        starts[band] = place
        for chunk in range(counts.shape[0]):
            count = counts[chunk, band]
            counts[chunk, band] = place
            place += count
    starts[-1] = place


@kernel
def fill_bands(counter_address, listed, bands, places, entries):  # type: ignore[no-untyped-def]
    """entries (E,) uint32: the triangles of each band. places: of `place_bands`."""
    while True:
        chunk = fetch_add(counter_address, 1)
        if chunk >= len(places):
            return
        for k in range(chunk * CHUNK, chunk * CHUNK + places[chunk, -1]):
            for band in range(bands[k, 0], bands[k, 1] + 1):
                entries[places[chunk, band]] = listed[k]
                places[chunk, band] += 1
