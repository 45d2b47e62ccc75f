"""Kernels that find the copies that may be visible, by a depth per tile of pixels.

A triangle is rasterised onto tiles conservatively: every tile that a ray through it may lie in, with a lower bound on
the depth there. Coordinates are homogeneous pixels (a, b, c) as in `projection_kernels`. The ray at (x, y) meets the
plane of corners p0, p1, p2, with normal n = (p1 - p0) x (p2 - p0), at

    1 / depth = n . (x, y, 1) / n . p0

This is linear in x and y, also for triangles that reach behind the eye. So are the three edge functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.alignment.copies_kernels import write_copy
from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import MARGIN_PIXELS

CHUNK = 1024
"""Triangles a thread takes at a time."""

LINES = 4
"""Rows of a triangle's linear functions: three edges, then the inverse depth."""

_RELIABLE = 1e-9
"""A float64 difference below this fraction of its terms is taken as noise; the bounding box is used instead."""


class TileGrid(NamedTuple):
    """A grid of tiles over an image. tile_width, tile_height: pixels of a tile; the last of a row or column may be cut.
    width, height: pixels of the image."""

    tile_width: int
    tile_height: int
    width: int
    height: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of tiles."""
        return -(-self.height // self.tile_height), -(-self.width // self.tile_width)


class Wanted(NamedTuple):
    """Which copies the first pass gets.

    left_out: (F,) bool, triangles without copies. inverse_depth: (tile rows, tile columns) float64, from which
    on a triangle is wanted in a tile: 0 for all, inf for none. first_cell, last_cell: (tile columns,) int64, the
    columns of cells that a column of tiles meets. cell_height: pixels.
    """

    left_out: NDArray[np.bool_]
    inverse_depth: NDArray[np.float64]
    first_cell: NDArray[np.int64]
    last_cell: NDArray[np.int64]
    cell_height: int


class Footprint(NamedTuple):
    """The pixels that a triangle may cover; left > right if there are none. nearest: inverse depth of its nearest
    corner in front. lines: its reliable linear functions, 0 or LINES."""

    left: float
    right: float
    top: float
    bottom: float
    nearest: float
    lines: int


@njit(forceinline=True)
def _set_up(points_pixels, faces, triangle, grid, lines):  # type: ignore[no-untyped-def]
    """The `Footprint` of a triangle, whose linear functions are written into `lines`, (LINES, 3)."""
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    a0, b0, c0 = points_pixels[v0, 0], points_pixels[v0, 1], points_pixels[v0, 2]
    a1, b1, c1 = points_pixels[v1, 0], points_pixels[v1, 1], points_pixels[v1, 2]
    a2, b2, c2 = points_pixels[v2, 0], points_pixels[v2, 1], points_pixels[v2, 2]
    left, right, top, bottom, nearest = 0.0, float(grid.width), 0.0, float(grid.height), np.inf
    if c0 < 0.0 and c1 < 0.0 and c2 < 0.0:
        return Footprint(1.0, 0.0, 1.0, 0.0, 0.0, 0)
    closest = min(c0, c1, c2)
    largest_a, largest_b = max(abs(a0), abs(a1), abs(a2)), max(abs(b0), abs(b1), abs(b2))
    if closest > 1e-12 * max(largest_a, largest_b, c0, c1, c2):
        x0, x1, x2 = a0 / c0, a1 / c1, a2 / c2
        y0, y1, y2 = b0 / c0, b1 / c1, b2 / c2
        left, right = max(left, min(x0, x1, x2) - MARGIN_PIXELS), min(right, max(x0, x1, x2) + MARGIN_PIXELS)
        top, bottom = max(top, min(y0, y1, y2) - MARGIN_PIXELS), min(bottom, max(y0, y1, y2) + MARGIN_PIXELS)
        nearest = 1.0 / closest
        if left > right or top > bottom:
            return Footprint(1.0, 0.0, 1.0, 0.0, 0.0, 0)
        tile_w, tile_h = grid.tile_width, grid.tile_height
        if int(left / tile_w) == int(right / tile_w) and int(top / tile_h) == int(bottom / tile_h):
            return Footprint(left, right, top, bottom, nearest, 0)  # a single tile needs no functions
    ua, ub, uc = a1 - a0, b1 - b0, c1 - c0
    wa, wb, wc = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = ub * wc - uc * wb, uc * wa - ua * wc, ua * wb - ub * wa
    volume = na * a0 + nb * b0 + nc * c0
    rounding = 1e-10 * largest_a * largest_b * max(abs(c0), abs(c1), abs(c2))
    if not abs(volume) > _RELIABLE * (abs(na * a0) + abs(nb * b0) + abs(nc * c0)) + rounding:
        return Footprint(left, right, top, bottom, nearest, 0)
    inverse = 1.0 / volume
    lines[3, 0], lines[3, 1], lines[3, 2] = na * inverse, nb * inverse, nc * inverse
    sign = 1.0 if volume > 0.0 else -1.0
    for edge in range(3):
        if edge == 0:
            pa, pb, pc, qa, qb, qc = a1, b1, c1, a2, b2, c2
        elif edge == 1:
            pa, pb, pc, qa, qb, qc = a2, b2, c2, a0, b0, c0
        else:
            pa, pb, pc, qa, qb, qc = a0, b0, c0, a1, b1, c1
        ea, eb, ec = pb * qc - pc * qb, pc * qa - pa * qc, pa * qb - pb * qa
        noise = 1e-14 * ((abs(pb * qc) + abs(pa * qc)) * max(grid.width, grid.height) + abs(pa * qb))
        if not abs(ea) + abs(eb) > noise:
            ea, eb, ec = 0.0, 0.0, 0.0  # too short to have a direction
        lines[edge, 0], lines[edge, 1], lines[edge, 2] = sign * ea, sign * eb, sign * ec
    return Footprint(left, right, top, bottom, nearest, LINES)


@njit(forceinline=True)
def _tiles_in_row(lines, footprint, ty, grid):  # type: ignore[no-untyped-def]
    """First and last tile of row ty that the triangle may meet; first > last where there is none."""
    top, bottom = ty * grid.tile_height - MARGIN_PIXELS, (ty + 1) * grid.tile_height + MARGIN_PIXELS
    left, right = footprint.left, footprint.right
    for k in range(footprint.lines):
        slope = lines[k, 0]
        constant = lines[k, 2] + max(lines[k, 1] * top, lines[k, 1] * bottom)
        if slope > 0.0:
            left = max(left, -constant / slope - MARGIN_PIXELS)
        elif slope < 0.0:
            right = min(right, -constant / slope + MARGIN_PIXELS)
        elif constant < 0.0:
            return 1, 0
    if left > right:
        return 1, 0
    return int(left / grid.tile_width), min(int(right / grid.tile_width), (grid.width - 1) // grid.tile_width)


@njit(forceinline=True)
def _inverse_depth(lines, footprint, tx, ty, grid):  # type: ignore[no-untyped-def]
    """Upper bound on 1 / depth in a tile."""
    if footprint.lines == 0:
        return footprint.nearest
    x0, x1 = tx * grid.tile_width - MARGIN_PIXELS, (tx + 1) * grid.tile_width + MARGIN_PIXELS
    y0, y1 = ty * grid.tile_height - MARGIN_PIXELS, (ty + 1) * grid.tile_height + MARGIN_PIXELS
    slope_x, slope_y = lines[3, 0], lines[3, 1]
    found = lines[3, 2] + max(slope_x * x0, slope_x * x1) + max(slope_y * y0, slope_y * y1)
    return min(found, footprint.nearest)


@njit(forceinline=True)
def _cells_met(footprint, grid, wanted):  # type: ignore[no-untyped-def]
    """First and last column, first and last row of the cells that a triangle's tiles meet."""
    last_tile = len(wanted.first_cell) - 1
    first = wanted.first_cell[min(int(footprint.left / grid.tile_width), last_tile)]
    last = wanted.last_cell[min(int(footprint.right / grid.tile_width), last_tile)]
    height = wanted.cell_height
    return first, last, int(footprint.top / height), min(int(footprint.bottom / height), grid.height // height - 1)


@njit(forceinline=True)
def _mark_cells(lines, footprint, j, is_left_out, grid, wanted, near, tiles):  # type: ignore[no-untyped-def]
    """Set `near` for the columns of cells in row j where the triangle is wanted.

    Returns the first and last row of tiles it meets there; tiles[ty] are the first and last tile in each row.
    """
    ty_first = max(int(footprint.top / grid.tile_height), j * wanted.cell_height // grid.tile_height)
    ty_last = min(int(footprint.bottom / grid.tile_height), ((j + 1) * wanted.cell_height - 1) // grid.tile_height)
    for ty in range(ty_first, ty_last + 1):
        first, last = _tiles_in_row(lines, footprint, ty, grid)
        tiles[ty, 0], tiles[ty, 1] = first, last
        if is_left_out:
            continue
        for tx in range(first, last + 1):
            if _inverse_depth(lines, footprint, tx, ty, grid) >= wanted.inverse_depth[ty, tx]:
                for i in range(wanted.first_cell[tx], wanted.last_cell[tx] + 1):
                    near[i] = 1
    return ty_first, ty_last


@kernel
def count_visible(counter_address, points_pixels, faces, grid, wanted, depth_slack, hidden, counts):  # type: ignore[no-untyped-def]
    """Count the cells that each triangle's copies are kept in, and bound what is left out.

    points_pixels: (V, 3) float64 homogeneous pixels. grid: `TileGrid`. wanted: `Wanted`. depth_slack: (F,) float64,
    relative margin on a triangle's depth. hidden: (tile rows, tile columns) float64, raised to the largest inverse
    depth of what some cell of the tile leaves out; this thread's. counts: (F,) int64, written.
    """
    lines, tiles = np.empty((LINES, 3)), np.empty((hidden.shape[0], 2), np.int64)
    near = np.zeros(wanted.last_cell[-1] + 1, np.uint8)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            counts[triangle] = 0
            footprint = _set_up(points_pixels, faces, triangle, grid, lines)
            if footprint.left > footprint.right:
                continue
            first, last, row_first, row_last = _cells_met(footprint, grid, wanted)
            is_left_out, slack = wanted.left_out[triangle], 1.0 + depth_slack[triangle]
            for j in range(row_first, row_last + 1):
                ty_first, ty_last = _mark_cells(lines, footprint, j, is_left_out, grid, wanted, near, tiles)
                kept = 0
                for i in range(first, last + 1):
                    kept += near[i]
                counts[triangle] += kept
                if kept <= last - first:
                    for ty in range(ty_first, ty_last + 1):
                        for tx in range(tiles[ty, 0], tiles[ty, 1] + 1):
                            missing = False
                            for i in range(wanted.first_cell[tx], wanted.last_cell[tx] + 1):
                                missing = missing or near[i] == 0
                            if missing:
                                found = _inverse_depth(lines, footprint, tx, ty, grid)
                                hidden[ty, tx] = max(hidden[ty, tx], found * slack)
                if kept:
                    for i in range(first, last + 1):
                        near[i] = 0


@kernel
def fill_visible(counter_address, points_pixels, points_ray, faces, grid, wanted, starts, target):  # type: ignore[no-untyped-def]
    """Write the sheared copies that `count_visible` counted, triangle t's from starts[t] on. target: `CopyTarget`."""
    lines, tiles = np.empty((LINES, 3)), np.empty((wanted.inverse_depth.shape[0], 2), np.int64)
    near = np.zeros(wanted.last_cell[-1] + 1, np.uint8)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy = starts[triangle]
            if copy == starts[triangle + 1]:
                continue
            footprint = _set_up(points_pixels, faces, triangle, grid, lines)
            first, last, row_first, row_last = _cells_met(footprint, grid, wanted)
            everywhere = starts[triangle + 1] - copy == (last - first + 1) * (row_last - row_first + 1)
            for j in range(row_first, row_last + 1):
                if not everywhere:
                    _mark_cells(lines, footprint, j, wanted.left_out[triangle], grid, wanted, near, tiles)
                for i in range(first, last + 1):
                    if everywhere or near[i] != 0:
                        near[i] = 0
                        write_copy(points_pixels, points_ray, faces, triangle, i, j, copy, target)
                        copy += 1


@kernel
def hide(points_pixels, faces, grid, depth_slack, hidden):  # type: ignore[no-untyped-def]
    """Raise `hidden` to the largest inverse depth of any triangle in each tile; arguments as for `count_visible`."""
    lines = np.empty((LINES, 3))
    for triangle in range(len(faces)):
        footprint = _set_up(points_pixels, faces, triangle, grid, lines)
        if footprint.left > footprint.right:
            continue
        ty_last = min(int(footprint.bottom / grid.tile_height), hidden.shape[0] - 1)
        for ty in range(int(footprint.top / grid.tile_height), ty_last + 1):
            first, last = _tiles_in_row(lines, footprint, ty, grid)
            for tx in range(first, last + 1):
                found = _inverse_depth(lines, footprint, tx, ty, grid) * (1.0 + depth_slack[triangle])
                hidden[ty, tx] = max(hidden[ty, tx], found)
