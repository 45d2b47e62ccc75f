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

CHUNK = 4096
"""Vertices, or triangles, a thread takes at a time."""

_NOTHING = 1e-60
"""Pixel positions below are 0, so that no product of exact decisions leaves float64."""


@kernel
def project(counter_address, vertices, eye, to_pixels, depth_axis, least_depth, points):  # type: ignore[no-untyped-def]
    """World points (V, 3) float32 -> (V, 4) float64: x, y in pixels, nearness; the last is left alone.

    to_pixels: (3, 4) float64, of homogeneous eye space. depth_axis: (3,) float64, the view axis in eye space. Nearness
    is 1 / depth, or -depth where rays are parallel: linear across the image either way, and the larger, the nearer.
    least_depth: what smaller depths count as, on either side of the eye plane; 0 where rays are parallel.
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
                    depth = least_depth if depth >= 0.0 else -least_depth
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


@kernel
def list_triangles(  # type: ignore[no-untyped-def]
    counter_address, points, faces, parallel, width, height, band_rows, listed, bands, counts
):  # fmt: skip
    """The triangles that may hold a sample: listed (F,) uint32, from the first place of each chunk on; bands (F, 2)
    int32, their first and last band; counts (chunks, bands + 1) int64, so many in each band and, last, in the chunk."""
    band_count = counts.shape[1] - 1
    while True:
        chunk = fetch_add(counter_address, 1)
        start = chunk * CHUNK
        if start >= len(faces):
            return
        place = start
        for band in range(band_count + 1):
            counts[chunk, band] = 0
        for triangle in range(start, min(start + CHUNK, len(faces))):
            v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
            x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
            x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
            x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
            if parallel:
                if w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
                    continue
            elif w0 < 0.0 and w1 < 0.0 and w2 < 0.0:
                continue
            if parallel or min(w0, w1, w2) > 0.0:
                low_x, high_x = min(x0, x1, x2), max(x0, x1, x2)
                low_y, high_y = min(y0, y1, y2), max(y0, y1, y2)
            else:
                low_x, high_x = _reach(x0, x1, x2, w0, w1, w2)
                low_y, high_y = _reach(y0, y1, y2, w0, w1, w2)
            left, right = max(np.ceil(low_x), 0.0), min(np.floor(high_x), width - 1.0)
            top, bottom = max(np.ceil(low_y), 0.0), min(np.floor(high_y), height - 1.0)
            if left <= right and top <= bottom:
                first, last = int(top) // band_rows, int(bottom) // band_rows
                listed[place], bands[place, 0], bands[place, 1] = triangle, first, last
                place += 1
                for band in range(first, last + 1):
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
