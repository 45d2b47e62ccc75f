"""Cells with a scene of their own: which triangles each gets, and the loop over their pixels."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.embree.layout import (
    HIT_GEOM_ID,
    HIT_PRIM_ID,
    RAY_DIR_X,
    RAY_DIR_Y,
    RAY_DIR_Z,
    RAY_TFAR,
    RAY_WORDS,
)
from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add
from atra.kernels.planning import (
    _POLYGON,
    CHUNK,
    _cell_range,
    _columns_in_row,
    _front_part,
    _load_triangle,
    _pixel_range,
)
from atra.kernels.tracing import _INFINITY, _MISS, _intersect, ray_component


@kernel
def list_cells(counter_address, points_pixels, faces, nx, ny, cell_width, cell_height, starts, cells):  # type: ignore[no-untyped-def]
    """cells[starts[t]:starts[t + 1]] = the cells (row-major numbers) triangle t meets, as `count_copies` counted."""
    polygon, first, second = np.empty((_POLYGON, 3)), np.empty((_POLYGON, 3)), np.empty((_POLYGON, 3))
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy = starts[triangle]
            if copy == starts[triangle + 1]:
                continue
            nearest, farthest, largest = _load_triangle(points_pixels, faces, triangle, polygon)
            tiny = 1e-12 * largest
            corners = _front_part(polygon, nearest, farthest, first)
            y_low, y_high = _pixel_range(polygon, corners, 1, tiny)
            top, bottom = _cell_range(y_low, y_high, cell_height, ny)
            for j in range(top, bottom + 1):
                left, right = _columns_in_row(
                    polygon, corners, j, cell_width, cell_height, nx, y_low, y_high, tiny, first, second
                )
                for i in range(left, right + 1):
                    cells[copy] = j * nx + i
                    copy += 1


@kernel
def sort_by_cell(triangle_starts, cells, faces, cell_starts, cell_faces, prim_ids):  # type: ignore[no-untyped-def]
    """Turn the cells of each triangle into the triangles of each cell, ascending: a counting sort.

    cell_starts: (cells + 1,) int64, cell_faces: (N, 3) uint32, prim_ids: (N,) int64; all written.
    """
    cell_starts[:] = 0
    for cell in cells:
        cell_starts[cell + 1] += 1
    for cell in range(1, len(cell_starts)):
        cell_starts[cell] += cell_starts[cell - 1]
    places = cell_starts[:-1].copy()
    for triangle in range(len(faces)):
        for copy in range(triangle_starts[triangle], triangle_starts[triangle + 1]):
            place = places[cells[copy]]
            places[cells[copy]] += 1
            prim_ids[place] = triangle
            for corner in range(3):
                cell_faces[place, corner] = faces[triangle, corner]


@cache
def tile_kernel(shape_x: int, shape_y: int) -> Callable[..., None]:
    """The loop over cells and their pixels, in packets of shape_x x shape_y pixels (constants of the code)."""
    width = shape_x * shape_y
    dir_x, dir_y, dir_z, tfar = RAY_DIR_X * width, RAY_DIR_Y * width, RAY_DIR_Z * width, RAY_TFAR * width
    hit_prim_id, hit_geom_id = (RAY_WORDS + HIT_PRIM_ID) * width, (RAY_WORDS + HIT_GEOM_ID) * width

    @kernel
    def trace_tiles(  # type: ignore[no-untyped-def]
        counter_address, scenes, cell_starts, prim_ids, packet, packet_ids, valid, arguments_address,
        column_directions, row_directions, nx, cell_width, cell_height, depth, prim_id,
    ):  # fmt: skip
        """Trace the pixels of each cell against its own scene, until the shared counter runs past the last cell.

        scenes: (cells,) int64 RTCScene handles, 0 for a cell without triangles. prim_ids: the mesh's number of each
        triangle, those of cell k from cell_starts[k] on. Packet, directions, outputs as in `trace_pixels`.
        """
        packet_address, valid_address = packet.ctypes.data, valid.ctypes.data
        while True:
            cell = fetch_add(counter_address, 1)
            if cell >= len(scenes):
                return
            left, top, first = cell % nx * cell_width, cell // nx * cell_height, cell_starts[cell]
            if scenes[cell] == 0:
                for y in range(top, top + cell_height):
                    for x in range(left, left + cell_width):
                        depth[y, x] = _INFINITY
                        prim_id[y, x] = _MISS
                continue
            for y0 in range(top, top + cell_height, shape_y):
                for x0 in range(left, left + cell_width, shape_x):
                    columns, rows = min(shape_x, left + cell_width - x0), min(shape_y, top + cell_height - y0)
                    for row in range(shape_y):
                        for column in range(shape_x):
                            lane = row * shape_x + column
                            x, y = x0 + min(column, columns - 1), y0 + min(row, rows - 1)
                            packet[dir_x + lane] = ray_component(column_directions[0, x], row_directions[0, y])
                            packet[dir_y + lane] = ray_component(column_directions[1, x], row_directions[1, y])
                            packet[dir_z + lane] = ray_component(column_directions[2, x], row_directions[2, y])
                            valid[lane] = -1 if row < rows and column < columns else 0
                    for lane in range(width):
                        packet[tfar + lane] = _INFINITY
                        packet_ids[hit_prim_id + lane] = _MISS
                        packet_ids[hit_geom_id + lane] = _MISS
                    _intersect(width, valid_address, scenes[cell], packet_address, arguments_address)
                    for row in range(rows):
                        for column in range(columns):
                            lane = row * shape_x + column
                            found = packet_ids[hit_prim_id + lane]
                            if found != _MISS:
                                found = np.uint32(prim_ids[first + found])
                            depth[y0 + row, x0 + column] = packet[tfar + lane]
                            prim_id[y0 + row, x0 + column] = found

    return trace_tiles
