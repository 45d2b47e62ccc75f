"""Kernels that write sheared copies of triangles for the cells that each triangle meets."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import (
    CHUNK,
    CORNERS,
    cell_range,
    columns_in_row,
    front_part,
    load_triangle,
    pixel_range,
)


@njit(forceinline=True)
def write_copy(points_pixels, points_ray, faces, triangle, shears_x, shears_y, i, j, copy, vertices):  # type: ignore[no-untyped-def]
    """Shear a triangle for cell (i, j) and write it as copy number `copy` of `vertices`, (3 N, 3)."""
    for corner in range(3):
        vertex = faces[triangle, corner]
        depth = points_pixels[vertex, 2]
        for axis in range(3):
            shear = (shears_x[i, axis] + shears_y[j, axis]) * depth
            vertices[3 * copy + corner, axis] = points_ray[vertex, axis] - shear


@kernel
def fill_copies(  # type: ignore[no-untyped-def]
    counter_address, points_pixels, points_ray, faces, culling, nx, ny, cell_width, cell_height,
    shears_x, shears_y, first_pixel, row_stride, starts, vertices, records,
):  # fmt: skip
    """Write the sheared copies of each triangle from starts[t] on.

    points_ray: (V, 3) float64. shears_x: (nx, 3), shears_y: (ny, 3) float64, a point's shift by its column and row of
    cells per unit of c, which is the depth, or 1 for parallel rays. first_pixel: the image's first pixel in the output.
    vertices: (3 N, 3) float32. records: (N,) int64, prim_id in the low half, in the high half the pixel distance from
    the reference cell to the copy's.
    """
    polygon, first, second = (np.empty((CORNERS, 3)), np.empty((CORNERS, 3)), np.empty((CORNERS, 3)))
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy, end = starts[triangle], starts[triangle + 1]
            if copy == end:
                continue
            nearest, farthest, largest = load_triangle(points_pixels, faces, triangle, polygon)
            tiny = 1e-12 * largest
            top, bottom, corners, y_low, y_high = 0, ny - 1, 0, 0.0, 0.0
            if culling:
                corners = front_part(polygon, nearest, farthest, first)
                y_low, y_high = pixel_range(polygon, corners, 1, tiny)
                top, bottom = cell_range(y_low, y_high, cell_height, ny)
            for j in range(top, bottom + 1):
                left, right = 0, nx - 1
                if culling:
                    left, right = columns_in_row(
                        polygon, corners, j, cell_width, cell_height, nx, y_low, y_high, tiny, first, second
                    )
                for i in range(left, right + 1):
                    write_copy(points_pixels, points_ray, faces, triangle, shears_x, shears_y, i, j, copy, vertices)
                    pixels = first_pixel + j * cell_height * row_stride + i * cell_width
                    records[copy] = triangle | (pixels << 32)
                    copy += 1
