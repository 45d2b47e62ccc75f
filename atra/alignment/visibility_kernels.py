"""Kernels that find the copies that may be visible, by a depth per tile of pixels.

A triangle is rasterised onto tiles conservatively: every tile that a ray through it may lie in, with a lower bound on
the depth there. Coordinates are homogeneous pixels (a, b, c) as in `projection_kernels`. The ray at (x, y) meets the
plane of corners p0, p1, p2, with normal n = (p1 - p0) x (p2 - p0), at

    1 / depth = n . (x, y, 1) / n . p0

This is linear in x and y, also for triangles that reach behind the eye. So are the three edge functions.
"""

from __future__ import annotations

import numpy as np

from atra.alignment.culling_kernels import write_copy
from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import MARGIN_PIXELS

CHUNK = 1024
"""Triangles a thread takes at a time."""

LINES = 4
"""Rows of a triangle's linear functions: three edges, then the inverse depth."""

_RELIABLE = 1e-9
"""A float64 difference below this fraction of its terms is taken as noise; the bounding box is used instead."""


@njit(forceinline=True)
def _set_up(points_pixels, faces, triangle, tile_w, tile_h, width, height, lines):  # type: ignore[no-untyped-def]
    """Write the triangle's linear functions into `lines`, (LINES, 3).

    Returns (left, right, top, bottom, inverse depth of the nearest corner in front, reliable lines: 0 or LINES); left >
    right for a triangle outside the image.
    """
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    a0, b0, c0 = points_pixels[v0, 0], points_pixels[v0, 1], points_pixels[v0, 2]
    a1, b1, c1 = points_pixels[v1, 0], points_pixels[v1, 1], points_pixels[v1, 2]
    a2, b2, c2 = points_pixels[v2, 0], points_pixels[v2, 1], points_pixels[v2, 2]
    left, right, top, bottom, nearest = 0.0, float(width), 0.0, float(height), np.inf
    if c0 < 0.0 and c1 < 0.0 and c2 < 0.0:
        return 1.0, 0.0, 1.0, 0.0, 0.0, 0
    closest = min(c0, c1, c2)
    largest_a, largest_b = max(abs(a0), abs(a1), abs(a2)), max(abs(b0), abs(b1), abs(b2))
    if closest > 1e-12 * max(largest_a, largest_b, c0, c1, c2):
        x0, x1, x2 = a0 / c0, a1 / c1, a2 / c2
        y0, y1, y2 = b0 / c0, b1 / c1, b2 / c2
        left, right = max(left, min(x0, x1, x2) - MARGIN_PIXELS), min(right, max(x0, x1, x2) + MARGIN_PIXELS)
        top, bottom = max(top, min(y0, y1, y2) - MARGIN_PIXELS), min(bottom, max(y0, y1, y2) + MARGIN_PIXELS)
        nearest = 1.0 / closest
        if left > right or top > bottom:
            return 1.0, 0.0, 1.0, 0.0, 0.0, 0
        if int(left / tile_w) == int(right / tile_w) and int(top / tile_h) == int(bottom / tile_h):
            return left, right, top, bottom, nearest, 0  # a single tile needs no functions
    ua, ub, uc = a1 - a0, b1 - b0, c1 - c0
    wa, wb, wc = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = ub * wc - uc * wb, uc * wa - ua * wc, ua * wb - ub * wa
    volume = na * a0 + nb * b0 + nc * c0
    rounding = 1e-10 * largest_a * largest_b * max(abs(c0), abs(c1), abs(c2))
    if not abs(volume) > _RELIABLE * (abs(na * a0) + abs(nb * b0) + abs(nc * c0)) + rounding:
        return left, right, top, bottom, nearest, 0
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
        noise = 1e-14 * ((abs(pb * qc) + abs(pa * qc)) * max(width, height) + abs(pa * qb))
        if abs(ea) + abs(eb) > noise:
            lines[edge, 0], lines[edge, 1], lines[edge, 2] = sign * ea, sign * eb, sign * ec
        else:  # an edge too short to have a direction
            lines[edge, 0], lines[edge, 1], lines[edge, 2] = 0.0, 0.0, 0.0
    return left, right, top, bottom, nearest, LINES


@njit(forceinline=True)
def _columns(lines, count, left, right, top, bottom):  # type: ignore[no-untyped-def]
    """Pixel range (low, high) of the triangle between two image rows; low > high where it is absent."""
    for k in range(count):
        slope = lines[k, 0]
        constant = lines[k, 2] + max(lines[k, 1] * top, lines[k, 1] * bottom)
        if slope > 0.0:
            left = max(left, -constant / slope - MARGIN_PIXELS)
        elif slope < 0.0:
            right = min(right, -constant / slope + MARGIN_PIXELS)
        elif constant < 0.0:
            return 1.0, 0.0
    return left, right


@njit(forceinline=True)
def _cells(left, right, tile_w, first_cell, last_cell):  # type: ignore[no-untyped-def]
    """First and last column of cells met by the tiles between two pixel positions."""
    last_tile = len(first_cell) - 1
    return first_cell[min(int(left / tile_w), last_tile)], last_cell[min(int(right / tile_w), last_tile)]


@njit(forceinline=True)
def _inverse_depth(lines, count, nearest, tx, top, bottom, tile_w):  # type: ignore[no-untyped-def]
    """Upper bound on 1 / depth in a tile."""
    if count == 0:
        return nearest
    x0, x1 = tx * tile_w - MARGIN_PIXELS, (tx + 1) * tile_w + MARGIN_PIXELS
    slope_x, slope_y = lines[3, 0], lines[3, 1]
    found = lines[3, 2] + max(slope_x * x0, slope_x * x1) + max(slope_y * top, slope_y * bottom)
    return min(found, nearest)


@njit(forceinline=True)
def _mark_cells(  # type: ignore[no-untyped-def]
    lines, count, left, right, top, bottom, nearest, j, cell_height, tile_w, tile_h, first_cell, last_cell, wanted,
    seen, left_out, near, tiles,
):  # fmt: skip
    """Set `near` for the columns of cells in row j where the triangle may be visible, unless it is left out.

    Returns the first and last row of tiles it meets there; tiles[ty] are the first and last tile in each row.
    """
    ty_first = max(int(top / tile_h), j * cell_height // tile_h)
    ty_last = min(int(bottom / tile_h), ((j + 1) * cell_height - 1) // tile_h)
    for ty in range(ty_first, ty_last + 1):
        y0, y1 = ty * tile_h - MARGIN_PIXELS, (ty + 1) * tile_h + MARGIN_PIXELS
        low, high = _columns(lines, count, left, right, y0, y1)
        if low > high:
            tiles[ty, 0], tiles[ty, 1] = 1, 0
            continue
        first, last = int(low / tile_w), min(int(high / tile_w), len(first_cell) - 1)
        tiles[ty, 0], tiles[ty, 1] = first, last
        if left_out:
            continue
        for tx in range(first, last + 1):
            if seen or _inverse_depth(lines, count, nearest, tx, y0, y1, tile_w) >= wanted[ty, tx]:
                for i in range(first_cell[tx], last_cell[tx] + 1):
                    near[i] = 1
    return ty_first, ty_last


@kernel
def count_visible(  # type: ignore[no-untyped-def]
    counter_address, points_pixels, faces, seen, left_out, depth_slack, wanted, tile_w, tile_h, width, height,
    cell_height, first_cell, last_cell, hidden, counts,
):  # fmt: skip
    """Count the cells that each triangle's copies are kept in, and bound what is left out.

    points_pixels: (V, 3) float64 homogeneous pixels. seen: (F,) uint8, triangles to keep in every cell they meet.
    left_out: (F,) bool, triangles to keep nowhere. depth_slack: (F,) float64, relative margin on a triangle's depth.
    wanted: (tiles y, tiles x) float64, inverse depth from which a triangle is kept: 0 keeps all, inf none. first_cell,
    last_cell: (tiles x,), the columns of cells that a column of tiles meets. hidden: (tiles y, tiles x) float64,
    written: largest inverse depth of what some cell of the tile leaves out; this thread's. counts: (F,) int64, written.
    """
    lines = np.empty((LINES, 3))
    near = np.zeros(last_cell[-1] + 1, np.uint8)
    tiles = np.empty((wanted.shape[0], 2), np.int64)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            counts[triangle] = 0
            left, right, top, bottom, nearest, count = _set_up(
                points_pixels, faces, triangle, tile_w, tile_h, width, height, lines
            )
            if left > right:
                continue
            first, last = _cells(left, right, tile_w, first_cell, last_cell)
            row_first, row_last = int(top / cell_height), min(int(bottom / cell_height), height // cell_height - 1)
            tx, ty = int(left / tile_w), int(top / tile_h)
            slack = 1.0 + depth_slack[triangle]
            if (
                first == last and row_first == row_last and tx == int(right / tile_w) and ty == int(bottom / tile_h)
                and ty < wanted.shape[0] and tx < wanted.shape[1]
            ):  # fmt: skip  # most triangles of a fine mesh
                if not left_out[triangle] and (seen[triangle] or nearest >= wanted[ty, tx]):
                    counts[triangle] = 1
                else:
                    hidden[ty, tx] = max(hidden[ty, tx], nearest * slack)
                continue
            total = 0
            for j in range(row_first, row_last + 1):
                ty_first, ty_last = _mark_cells(
                    lines, count, left, right, top, bottom, nearest, j, cell_height, tile_w, tile_h, first_cell,
                    last_cell, wanted, seen[triangle], left_out[triangle], near, tiles,
                )  # fmt: skip
                kept = 0
                for i in range(first, last + 1):
                    kept += near[i]
                total += kept
                if kept <= last - first:
                    for ty in range(ty_first, ty_last + 1):
                        y0, y1 = ty * tile_h - MARGIN_PIXELS, (ty + 1) * tile_h + MARGIN_PIXELS
                        for tx in range(tiles[ty, 0], tiles[ty, 1] + 1):
                            missing = False
                            for i in range(first_cell[tx], last_cell[tx] + 1):
                                missing = missing or near[i] == 0
                            if missing:
                                found = _inverse_depth(lines, count, nearest, tx, y0, y1, tile_w)
                                hidden[ty, tx] = max(hidden[ty, tx], found * slack)
                if kept:
                    for i in range(first, last + 1):
                        near[i] = 0
            counts[triangle] = total


@kernel
def fill_visible(  # type: ignore[no-untyped-def]
    counter_address, points_pixels, points_ray, faces, seen, wanted, tile_w, tile_h, width, height, cell_width,
    cell_height, first_cell, last_cell, shears_x, shears_y, row_stride, starts, vertices, records,
):  # fmt: skip
    """Write the sheared copies that `count_visible` counted, from starts[t] on; outputs as in `fill_copies`."""
    lines = np.empty((LINES, 3))
    near = np.zeros(last_cell[-1] + 1, np.uint8)
    tiles = np.empty((wanted.shape[0], 2), np.int64)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            copy = starts[triangle]
            if copy == starts[triangle + 1]:
                continue
            left, right, top, bottom, nearest, count = _set_up(
                points_pixels, faces, triangle, tile_w, tile_h, width, height, lines
            )
            first, last = _cells(left, right, tile_w, first_cell, last_cell)
            row_first, row_last = int(top / cell_height), min(int(bottom / cell_height), height // cell_height - 1)
            everywhere = starts[triangle + 1] - copy == (last - first + 1) * (row_last - row_first + 1)
            for j in range(row_first, row_last + 1):
                if not everywhere:
                    _mark_cells(
                        lines, count, left, right, top, bottom, nearest, j, cell_height, tile_w, tile_h, first_cell,
                        last_cell, wanted, seen[triangle], False, near, tiles,
                    )  # fmt: skip
                for i in range(first, last + 1):
                    if near[i] == 0 and not everywhere:
                        continue
                    near[i] = 0
                    write_copy(points_pixels, points_ray, faces, triangle, shears_x, shears_y, i, j, copy, vertices)
                    records[copy] = triangle | ((j * cell_height * row_stride + i * cell_width) << 32)
                    copy += 1
