"""Projection of vertices to pixels, and the cells of an image that each triangle meets (paper §3.4).

A triangle is clipped against the eye plane and one row of cells; the rest spans one contiguous range of columns.
Coordinates are homogeneous pixels (a, b, c), in which frustums have planes: pixel position (a / c, b / c), depth c.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit

MARGIN_PIXELS = 0.125
"""Distance from a cell's pixels within which a triangle is kept; it covers the rounding of float32 rays."""

CHUNK = 4096
"""Triangles that a thread takes at a time."""

CORNERS = 8
"""Size of arrays for the corners of a polygon: a triangle clipped by three planes has at most six."""


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
def load_triangle(points_pixels, faces, triangle, polygon):  # type: ignore[no-untyped-def]
    """Copy a triangle's corners to `polygon`; returns nearest depth, farthest depth and largest coordinate."""
    nearest, farthest, largest = np.inf, -np.inf, 0.0
    for corner in range(3):
        vertex = faces[triangle, corner]
        for axis in range(3):
            value = points_pixels[vertex, axis]
            polygon[corner, axis] = value
            largest = max(largest, abs(value))
        nearest, farthest = min(nearest, polygon[corner, 2]), max(farthest, polygon[corner, 2])
    return nearest, farthest, largest


@njit(forceinline=True)
def front_part(polygon, nearest, farthest, scratch):  # type: ignore[no-untyped-def]
    """Clip a triangle at the eye plane in place; returns the number of corners, 0 = all is behind."""
    if nearest > 0.0:
        return 3
    if farthest < 0.0:
        return 0
    count = _clip(polygon, 3, scratch, 0.0, 0.0, 1.0)
    for corner in range(count):
        for axis in range(3):
            polygon[corner, axis] = scratch[corner, axis]
    return count


@njit(forceinline=True)
def columns_in_row(polygon, count, row, cell_width, cell_height, nx, y_low, y_high, tiny, first, second):  # type: ignore[no-untyped-def]
    """First and last column that the polygon meets in one row of cells."""
    top, bottom = row * cell_height - MARGIN_PIXELS, (row + 1) * cell_height + MARGIN_PIXELS
    if y_low >= top and y_high <= bottom:
        low, high = pixel_range(polygon, count, 0, tiny)
    else:
        count = _clip(polygon, count, first, 0.0, 1.0, -top)
        count = _clip(first, count, second, 0.0, -1.0, bottom)
        low, high = pixel_range(second, count, 0, tiny)
    return cell_range(low, high, cell_width, nx)


@njit(forceinline=True)
def meet_cells(points_pixels, faces, triangle, nx, ny, cell_width, cell_height, corners, columns):  # type: ignore[no-untyped-def]
    """First and last row of cells that a triangle meets, first > last if there is none; columns[j] are the first and
    last column in row j. corners: (3, CORNERS, 3) float64, for polygons. columns: (ny, 2) int64, written."""
    polygon, first, second = corners[0], corners[1], corners[2]
    nearest, farthest, largest = load_triangle(points_pixels, faces, triangle, polygon)
    tiny = 1e-12 * largest
    count = front_part(polygon, nearest, farthest, first)
    y_low, y_high = pixel_range(polygon, count, 1, tiny)
    top, bottom = cell_range(y_low, y_high, cell_height, ny)
    for j in range(top, bottom + 1):
        left, right = columns_in_row(polygon, count, j, cell_width, cell_height, nx, y_low, y_high, tiny, first, second)
        columns[j, 0], columns[j, 1] = left, right
    return top, bottom


@kernel
def count_copies(counter_address, points_pixels, faces, nx, ny, cell_width, cell_height, counts):  # type: ignore[no-untyped-def]
    """Set counts[t] to the number of cells that triangle t meets. points_pixels: (V, 3) float64 homogeneous pixels."""
    corners, columns = np.empty((3, CORNERS, 3)), np.empty((ny, 2), np.int64)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            total = 0
            top, bottom = meet_cells(points_pixels, faces, triangle, nx, ny, cell_width, cell_height, corners, columns)
            for j in range(top, bottom + 1):
                total += max(0, columns[j, 1] - columns[j, 0] + 1)
            counts[triangle] = total
