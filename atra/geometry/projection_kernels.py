"""Projection of vertices to pixels, and the cells of an image that each triangle meets (paper §3.4).

A triangle is clipped against the eye plane and one row of cells; the rest spans one contiguous range of columns.
Coordinates are homogeneous pixels (a, b, c), in which frustums have planes: pixel position (a / c, b / c), depth c.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit

MARGIN_PIXELS = 0.125
"""Distance from a cell's pixels within which a triangle is kept; it covers the rounding of float32 rays."""

CHUNK = 4096
"""Triangles that a thread takes at a time."""

CORNERS = 8
"""Size of arrays for the corners of a polygon: a triangle clipped by three planes has at most six."""


class MetRows(NamedTuple):
    """Rows of cells that a polygon meets; first > last if there is none.

    corners: their number, 0 = all is behind the eye. y_low, y_high: lowest and highest pixel position. tiny: a depth
    that is 0 but for rounding.
    """

    first: int
    last: int
    corners: int
    y_low: float
    y_high: float
    tiny: float


@kernel
def project_points(counter_address, vertices, eye, to_pixels, linear, points_pixels, points_ray):  # type: ignore[no-untyped-def]
    """Transform world points (V, 3) float32 to homogeneous pixels and to ray space, both (V, 3) float64.

    to_pixels: (3, 4) float64, from homogeneous eye space. linear: (3, 3) float64, eye space to ray space.
    """
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(vertices):
            return
        for point in range(start, min(start + CHUNK, len(vertices))):
            x, y, z = vertices[point, 0] - eye[0], vertices[point, 1] - eye[1], vertices[point, 2] - eye[2]
            for axis in range(3):
                projected = to_pixels[axis, 0] * x + to_pixels[axis, 1] * y + to_pixels[axis, 2] * z
                points_pixels[point, axis] = projected + to_pixels[axis, 3]
                points_ray[point, axis] = linear[axis, 0] * x + linear[axis, 1] * y + linear[axis, 2] * z


@njit  # not inlined: it has three rare callers in every kernel
def _clip(source, count, target, plane_a, plane_b, plane_c):  # type: ignore[no-untyped-def]
    """Clip a convex polygon to plane_a a + plane_b b + plane_c c >= 0; returns the number of corners left."""
    kept = 0
    for corner in range(count):
        following = corner + 1 if corner + 1 < count else 0
        here = plane_a * source[corner, 0] + plane_b * source[corner, 1] + plane_c * source[corner, 2]
        there = plane_a * source[following, 0] + plane_b * source[following, 1] + plane_c * source[following, 2]
        if here >= 0.0:
            for axis in range(3):
                target[kept, axis] = source[corner, axis]
            kept += 1
        if (here >= 0.0) != (there >= 0.0):
            s = here / (here - there)
            for axis in range(3):
                target[kept, axis] = source[corner, axis] + s * (source[following, axis] - source[corner, axis])
            kept += 1
    return kept


@njit(forceinline=True)
def pixel_range(polygon, count, axis, tiny):  # type: ignore[no-untyped-def]
    """Lowest and highest pixel position along an axis of a polygon in front of the eye; infinite at the eye plane."""
    low, high = np.inf, -np.inf
    for corner in range(count):
        value, c = polygon[corner, axis], polygon[corner, 2]
        if c > tiny:
            low, high = min(low, value / c), max(high, value / c)
        else:
            if value >= -tiny:
                high = np.inf
            if value <= tiny:
                low = -np.inf
    return low, high


@njit(forceinline=True)
def cell_range(low, high, cell_pixels, cell_count):  # type: ignore[no-untyped-def]
    """First and last cell that a range of pixels meets; first > last if there is none."""
    image_pixels = cell_pixels * cell_count
    if not (high >= -MARGIN_PIXELS and low <= image_pixels + MARGIN_PIXELS):
        return 1, 0
    first = int(np.floor(max(low - MARGIN_PIXELS, 0.0) / cell_pixels))
    last = int(np.floor(min(high + MARGIN_PIXELS, image_pixels - 0.5) / cell_pixels))
    return min(first, cell_count - 1), last


@njit(forceinline=True)
def find_rows(points_pixels, faces, triangle, cell_height, ny, polygon, scratch):  # type: ignore[no-untyped-def]
    """The rows of cells that a triangle meets: `MetRows`. Its part in front of the eye is written to `polygon`,
    (CORNERS, 3) float64; so may `scratch` be."""
    nearest, farthest, largest = np.inf, -np.inf, 0.0
    for corner in range(3):
        vertex = faces[triangle, corner]
        for axis in range(3):
            value = points_pixels[vertex, axis]
            polygon[corner, axis] = value
            largest = max(largest, abs(value))
        nearest, farthest = min(nearest, polygon[corner, 2]), max(farthest, polygon[corner, 2])
    count, tiny = 3, 1e-12 * largest
    if not nearest > 0.0:  # clipped at the eye plane
        count = 0 if farthest < 0.0 else _clip(polygon, 3, scratch, 0.0, 0.0, 1.0)
        for corner in range(count):
            for axis in range(3):
                polygon[corner, axis] = scratch[corner, axis]
    y_low, y_high = pixel_range(polygon, count, 1, tiny)
    first, last = cell_range(y_low, y_high, cell_height, ny)
    return MetRows(first, last, count, y_low, y_high, tiny)


@njit(forceinline=True)
def find_columns(met, polygon, row, cell_width, cell_height, nx, first, second):  # type: ignore[no-untyped-def]
    """First and last column that the polygon of `find_rows` meets in one row of cells; first, second: memory as its."""
    top, bottom = row * cell_height - MARGIN_PIXELS, (row + 1) * cell_height + MARGIN_PIXELS
    if met.y_low >= top and met.y_high <= bottom:
        low, high = pixel_range(polygon, met.corners, 0, met.tiny)
    else:
        count = _clip(polygon, met.corners, first, 0.0, 1.0, -top)
        count = _clip(first, count, second, 0.0, -1.0, bottom)
        low, high = pixel_range(second, count, 0, met.tiny)
    return cell_range(low, high, cell_width, nx)


@njit(forceinline=True)
def _range_of(value0, value1, value2, c0, c1, c2):  # type: ignore[no-untyped-def]
    position0, position1, position2 = value0 / c0, value1 / c1, value2 / c2
    return min(position0, position1, position2), max(position0, position1, position2)


@njit(forceinline=True)
def find_in_one_row(points_pixels, faces, triangle, nx, ny, cell_width, cell_height):  # type: ignore[no-untyped-def]
    """What `find_rows` and `find_columns` find, in half the time, for triangles before the eye in one row of cells.

    Returns the row, and the first and last column, first > last if there is none; row -1 for other triangles.
    """
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    a0, b0, c0 = points_pixels[v0, 0], points_pixels[v0, 1], points_pixels[v0, 2]
    a1, b1, c1 = points_pixels[v1, 0], points_pixels[v1, 1], points_pixels[v1, 2]
    a2, b2, c2 = points_pixels[v2, 0], points_pixels[v2, 1], points_pixels[v2, 2]
    if c0 < 0.0 and c1 < 0.0 and c2 < 0.0:
        return 0, 1, 0
    largest = max(abs(a0), abs(a1), abs(a2), abs(b0), abs(b1), abs(b2), abs(c0), abs(c1), abs(c2))
    if not min(c0, c1, c2) > 1e-12 * largest:
        return -1, 1, 0
    low, high = _range_of(b0, b1, b2, c0, c1, c2)
    row, last = cell_range(low, high, cell_height, ny)
    if row > last:
        return 0, 1, 0
    if row < last or low < row * cell_height - MARGIN_PIXELS or high > (row + 1) * cell_height + MARGIN_PIXELS:
        return -1, 1, 0
    low, high = _range_of(a0, a1, a2, c0, c1, c2)
    left, right = cell_range(low, high, cell_width, nx)
    return row, left, right


@kernel
def count_copies(counter_address, points_pixels, faces, nx, ny, cell_width, cell_height, counts):  # type: ignore[no-untyped-def]
    """Set counts[t] to the number of cells that triangle t meets. points_pixels: (V, 3) float64 homogeneous pixels."""
    polygon, first, second = np.empty((CORNERS, 3)), np.empty((CORNERS, 3)), np.empty((CORNERS, 3))
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            row, left, right = find_in_one_row(points_pixels, faces, triangle, nx, ny, cell_width, cell_height)
            counts[triangle] = max(0, right - left + 1)
            if row >= 0:
                continue
            total, met = 0, find_rows(points_pixels, faces, triangle, cell_height, ny, polygon, first)
            for j in range(met.first, met.last + 1):
                left, right = find_columns(met, polygon, j, cell_width, cell_height, nx, first, second)
                total += max(0, right - left + 1)
            counts[triangle] = total
