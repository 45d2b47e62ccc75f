"""Kernels that write sheared copies of triangles for the cells that each triangle meets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import CHUNK, CORNERS, find_columns, find_in_one_row, find_rows


class CopyTarget(NamedTuple):
    """Where the copies of an image's triangles are written.

    shears_x: (nx, 3), shears_y: (ny, 3) float64, a point's shift by its column and row of cells per unit of c, which is
    the depth, or 1 for parallel rays. cell_width, cell_height: pixels. first_pixel: the image's first pixel in the
    output, rows of which are row_stride pixels apart. vertices: (3 N, 3) float32. records: (N,) int64, prim_id in the
    low half, in the high half the pixel distance from the reference cell to the copy's.
    """

    shears_x: NDArray[np.float64]
    shears_y: NDArray[np.float64]
    cell_width: int
    cell_height: int
    first_pixel: int
    row_stride: int
    vertices: NDArray[np.float32]
    records: NDArray[np.int64]


@njit(forceinline=True)
def write_copy(points_pixels, points_ray, faces, triangle, i, j, copy, target):  # type: ignore[no-untyped-def]
    """Shear a triangle for cell (i, j) and write it as copy number `copy`."""
    for corner in range(3):
        vertex = faces[triangle, corner]
        depth = points_pixels[vertex, 2]
        for axis in range(3):
            shear = (target.shears_x[i, axis] + target.shears_y[j, axis]) * depth
            target.vertices[3 * copy + corner, axis] = points_ray[vertex, axis] - shear
    pixels = target.first_pixel + j * target.cell_height * target.row_stride + i * target.cell_width
    target.records[copy] = triangle | (pixels << 32)


@kernel
def fill_copies(counter_address, points_pixels, points_ray, faces, culling, nx, ny, starts, target):  # type: ignore[no-untyped-def]
    """Write the sheared copies of each triangle from starts[t] on. points_ray: (V, 3) float64. target: `CopyTarget`."""
    polygon, first, second = np.empty((CORNERS, 3)), np.empty((CORNERS, 3)), np.empty((CORNERS, 3))
    cell_width, cell_height = target.cell_width, target.cell_height
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy = starts[triangle]
            if copy == starts[triangle + 1]:
                continue
            row, left, right = -1, 0, nx - 1
            if culling:
                row, left, right = find_in_one_row(points_pixels, faces, triangle, nx, ny, cell_width, cell_height)
            if row >= 0:
                for i in range(left, right + 1):
                    write_copy(points_pixels, points_ray, faces, triangle, i, row, copy, target)
                    copy += 1
                continue
            met = find_rows(points_pixels, faces, triangle, cell_height, ny, polygon, first)
            for j in range(met.first if culling else 0, met.last + 1 if culling else ny):
                if culling:
                    left, right = find_columns(met, polygon, j, cell_width, cell_height, nx, first, second)
                for i in range(left, right + 1):
                    write_copy(points_pixels, points_ray, faces, triangle, i, j, copy, target)
                    copy += 1
