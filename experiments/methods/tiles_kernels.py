"""Kernels of cells with scenes of their own: listing each cell's triangles, and tracing its pixels."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    hit_distance,
    hit_prim_id,
    intersect,
    set_pixel_ray,
    set_unlimited,
)
from atra.geometry.projection_kernels import CHUNK, CORNERS, find_columns, find_rows


@kernel
def list_cells(counter_address, points_pixels, faces, nx, ny, cell_width, cell_height, starts, cells):  # type: ignore[no-untyped-def]
    """Write the cells that triangle t meets, as row-major numbers, to cells[starts[t]:starts[t + 1]]."""
    polygon, first, second = np.empty((CORNERS, 3)), np.empty((CORNERS, 3)), np.empty((CORNERS, 3))
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy = starts[triangle]
            if copy == starts[triangle + 1]:
                continue
            met = find_rows(points_pixels, faces, triangle, cell_height, ny, polygon, first)
            for j in range(met.first, met.last + 1):
                left, right = find_columns(met, polygon, j, cell_width, cell_height, nx, first, second)
                for i in range(left, right + 1):
                    cells[copy] = j * nx + i
                    copy += 1


class CellScenes(NamedTuple):
    """Cells with scenes of their own, row by row.

    handles: (cells,) int64, RTCScene handles; 0 for a cell without triangles. starts: (cells + 1,) int64, where each
    cell's triangles start in `prim_ids`, (N,) int64. columns: of cells. width, height: pixels of a cell.
    """

    handles: NDArray[np.int64]
    starts: NDArray[np.int64]
    prim_ids: NDArray[np.int64]
    columns: int
    width: int
    height: int


@cache
def tile_kernel(shape_x: int, shape_y: int) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels."""
    width = shape_x * shape_y

    @kernel
    def trace_tiles(counter_address, cells, packet, rays, image):  # type: ignore[no-untyped-def]
        """Trace the pixels of each cell through its own scene; threads share the counter. Packet, rays and image as in
        `trace_pixels`."""
        depth, prim_id = image.depth, image.prim_id
        while True:
            cell = fetch_add(counter_address, 1)
            if cell >= len(cells.handles):
                return
            left, top = cell % cells.columns * cells.width, cell // cells.columns * cells.height
            scene, first = cells.handles[cell], cells.starts[cell]
            if scene == 0:
                for y in range(top, top + cells.height):
                    for x in range(left, left + cells.width):
                        depth[y, x] = INFINITY
                        prim_id[y, x] = MISS
                continue
            for y0 in range(top, top + cells.height, shape_y):
                for x0 in range(left, left + cells.width, shape_x):
                    columns, rows = min(shape_x, left + cells.width - x0), min(shape_y, top + cells.height - y0)
                    for row in range(shape_y):
                        for column in range(shape_x):
                            lane = row * shape_x + column
                            x, y = x0 + min(column, columns - 1), y0 + min(row, rows - 1)
                            set_pixel_ray(packet, width, lane, False, rays, x, y)
                            packet.valid[lane] = -1 if row < rows and column < columns else 0
                    set_unlimited(packet, width)
                    intersect(width, packet.valid, scene, packet)
                    for row in range(rows):
                        for column in range(columns):
                            lane = row * shape_x + column
                            face = hit_prim_id(packet, width, lane)
                            if face != MISS:
                                face = np.uint32(cells.prim_ids[first + face])
                            depth[y0 + row, x0 + column] = hit_distance(packet, width, lane)
                            prim_id[y0 + row, x0 + column] = face

    return trace_tiles
