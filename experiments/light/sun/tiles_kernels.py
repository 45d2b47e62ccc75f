"""Kernels that find the triangles that parallel rays from tiles may meet, and map them onto one tile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.embree.packets_kernels import MISS
from atra.geometry.projection_kernels import MARGIN_PIXELS
from experiments.classification.bvh.binary import STACK

SIDE = 8
"""Blocks along a side of the rectangle of a tile's texels; block (i, j) is bit 8 j + i of 64."""

ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
"""All blocks of a tile."""

_FLAT = 1e-9
"""Area in blocks below which a triangle is seen edge-on."""

_LEAST = 2.0
"""Least area in blocks of a triangle that may cover one."""


class BoxTree(NamedTuple):
    """The triangles of a mesh in a tree of boxes.

    boxes: (N, 2, 3) float32, first, block_counts: (N,) int64, blocks: (B, 10, 4) float32 and prim_ids: (B, 4) uint32,
    as in `Bvh`, with edges in place of the second and third corners and `MISS` in unused entries. larger: (N,)
    uint8, the child with the larger box. vertices: (V, 3) float32. faces: (F, 3) uint32.
    """

    boxes: NDArray[np.float32]
    first: NDArray[np.int64]
    block_counts: NDArray[np.int64]
    larger: NDArray[np.uint8]
    blocks: NDArray[np.float32]
    prim_ids: NDArray[np.uint32]
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


class Prisms(NamedTuple):
    """What the rays of a direction from each of K tiles sweep. A vertex maps to onto vertex - shift; its last
    coordinate is the ray's parameter, above 0 in front of the tile.

    onto: (K, 3, 3) float64. shift: (K, 3) float64. off: (K,) float64, parameter where rays start. middle, half: (K, 2)
    float64, of the rectangle of the tile's texels.
    """

    onto: NDArray[np.float64]
    shift: NDArray[np.float64]
    off: NDArray[np.float64]
    middle: NDArray[np.float64]
    half: NDArray[np.float64]


@njit(forceinline=True)
def _row(prisms, tile, axis, middle, scale):  # type: ignore[no-untyped-def]
    """The map of one axis, relative to the rectangle's middle and in blocks."""
    onto, shift = prisms.onto, prisms.shift[tile, axis] + middle
    return scale * onto[tile, axis, 0], scale * onto[tile, axis, 1], scale * onto[tile, axis, 2], scale * shift


@njit(forceinline=True)
def _times(row, x, y, z):  # type: ignore[no-untyped-def]
    return row[0] * x + row[1] * y + row[2] * z


@njit(forceinline=True)
def _reach(row, x, y, z):  # type: ignore[no-untyped-def]
    return abs(row[0]) * x + abs(row[1]) * y + abs(row[2]) * z


@njit(forceinline=True)
def _blocks(low_x, high_x, low_y, high_y):  # type: ignore[no-untyped-def]
    """Bits of the blocks that a rectangle meets; blocks span -SIDE / 2 to SIDE / 2 on both axes."""
    half = SIDE / 2
    if low_x > half or high_x < -half or low_y > half or high_y < -half:
        return np.uint64(0)
    left, top = np.int64(max(low_x + half, 0.0)), np.int64(max(low_y + half, 0.0))
    right, bottom = np.int64(min(high_x + half, SIDE - 0.5)), np.int64(min(high_y + half, SIDE - 0.5))
    left, top = min(left, right), min(top, bottom)
    columns = np.uint64(0xFF) >> np.uint64(SIDE - 1 - (right - left)) << np.uint64(left)
    rows = ALL >> np.uint64(SIDE * (SIDE - 1 - (bottom - top))) << np.uint64(SIDE * top)
    return columns * np.uint64(0x0101010101010101) & rows


@njit(forceinline=True)
def _met_by_box(rows, margin, boxes, node):  # type: ignore[no-untyped-def]
    """Blocks whose rays may meet the box."""
    low_x, low_y, low_z = np.float64(boxes[node, 0, 0]), np.float64(boxes[node, 0, 1]), np.float64(boxes[node, 0, 2])
    x, y, z = 0.5 * (boxes[node, 1, 0] - low_x), 0.5 * (boxes[node, 1, 1] - low_y), 0.5 * (boxes[node, 1, 2] - low_z)
    mid_x, mid_y, mid_z = low_x + x, low_y + y, low_z + z
    if _times(rows[2], mid_x, mid_y, mid_z) - rows[2][3] + _reach(rows[2], x, y, z) <= 0.0:
        return np.uint64(0)
    across, down = _times(rows[0], mid_x, mid_y, mid_z) - rows[0][3], _times(rows[1], mid_x, mid_y, mid_z) - rows[1][3]
    wide, high = _reach(rows[0], x, y, z) + margin[0], _reach(rows[1], x, y, z) + margin[1]
    return _blocks(across - wide, across + wide, down - high, down + high)


@njit(forceinline=True)
def _corners(row, blocks, block, place):  # type: ignore[no-untyped-def]
    """A triangle along one axis: its first corner, and its edges from there."""
    x, y, z = blocks[block, 0, place], blocks[block, 1, place], blocks[block, 2, place]
    a, b, c = blocks[block, 3, place], blocks[block, 4, place], blocks[block, 5, place]
    d, e, f = blocks[block, 6, place], blocks[block, 7, place], blocks[block, 8, place]
    return _times(row, x, y, z) - row[3], _times(row, a, b, c), _times(row, d, e, f)


@njit(forceinline=True)
def _met_by_triangle(rows, margin, off, open_blocks, blocks, block, place):  # type: ignore[no-untyped-def]
    """Blocks whose rays may meet the triangle, and blocks whose rays all do."""
    none = np.uint64(0)
    x, x1, x2 = _corners(rows[0], blocks, block, place)
    y, y1, y2 = _corners(rows[1], blocks, block, place)
    low_x, high_x = x + min(x1, x2, 0.0) - margin[0], x + max(x1, x2, 0.0) + margin[0]
    low_y, high_y = y + min(y1, y2, 0.0) - margin[1], y + max(y1, y2, 0.0) + margin[1]
    met = _blocks(low_x, high_x, low_y, high_y) & open_blocks
    if met == none:
        return none, none
    z, z1, z2 = _corners(rows[2], blocks, block, place)
    if z + max(z1, z2, 0.0) <= 0.0:
        return none, none
    area = x1 * y2 - y1 * x2
    if abs(area) < _FLAT:
        return met, none
    if area < 0.0:
        area, x1, x2, y1, y2, z1, z2 = -area, x2, x1, y2, y1, z2, z1
    # Barycentric weights and parameter, times the area, at the middle; below, how much they change to the border.
    one, other = y * x2 - x * y2, x * y1 - y * x1
    rest, depth = area - one - other, z * area + one * z1 + other * z2
    slope_x, slope_y = y2 * z1 - y1 * z2, x1 * z2 - x2 * z1
    wide, high = SIDE / 2 + margin[0], SIDE / 2 + margin[1]
    if (
        one + abs(y2) * wide + abs(x2) * high < 0.0
        or other + abs(y1) * wide + abs(x1) * high < 0.0
        or rest + abs(y2 - y1) * wide + abs(x2 - x1) * high < 0.0
        or depth + abs(slope_x) * wide + abs(slope_y) * high <= 0.0
    ):
        return none, none
    if area < _LEAST or high_x - low_x < 1.0 or high_y - low_y < 1.0:
        return met, none
    wide, high = 0.5 + margin[0], 0.5 + margin[1]
    one -= abs(y2) * wide + abs(x2) * high
    other -= abs(y1) * wide + abs(x1) * high
    rest -= abs(y2 - y1) * wide + abs(x2 - x1) * high
    depth -= abs(slope_x) * wide + abs(slope_y) * high + off * area
    covered, bit = none, np.uint64(1)
    for j in range(SIDE):
        down = j + 0.5 - SIDE / 2
        for i in range(SIDE):
            across = i + 0.5 - SIDE / 2
            covers = one + across * y2 - down * x2 > 0.0
            covers &= other - across * y1 + down * x1 > 0.0
            covers &= rest - across * (y2 - y1) + down * (x2 - x1) > 0.0
            covers &= depth + across * slope_x + down * slope_y > 0.0
            covered |= bit if covers else none
            bit <<= np.uint64(1)
    return met, covered


@kernel
def find_triangles(counter_address, total_address, tree, prisms, found, met_by, kept, starts, counts, covered):  # type: ignore[no-untyped-def]
    """Find the triangles that rays of each tile may meet, except in blocks that one triangle is known to cover.

    total_address: of an int64, initially 0, to which all tiles' triangles are added. found: (F,) uint32 and met_by:
    (F,) uint64, this thread's. kept: (N,) uint32, written from starts[k] on, if all of a tile's fit. starts, counts:
    (K,) int64, written. covered: (K,) uint64, written: blocks whose rays all meet a triangle.
    """
    stack = np.empty(STACK, np.int64)
    while True:
        tile = fetch_add(counter_address, 1)
        if tile >= len(counts):
            return
        scale_x, scale_y = SIDE / 2 / prisms.half[tile, 0], SIDE / 2 / prisms.half[tile, 1]
        across = _row(prisms, tile, 0, prisms.middle[tile, 0], scale_x)
        down = _row(prisms, tile, 1, prisms.middle[tile, 1], scale_y)
        rows, off = (across, down, _row(prisms, tile, 2, 0.0, 1.0)), prisms.off[tile]
        margin = MARGIN_PIXELS * scale_x, MARGIN_PIXELS * scale_y
        open_blocks, count, depth = ALL, 0, 1
        stack[0] = 0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if _met_by_box(rows, margin, tree.boxes, node) & open_blocks == np.uint64(0):
                continue
            first, blocks = tree.first[node], tree.block_counts[node]
            if blocks == 0:
                larger = np.int64(tree.larger[node])
                stack[depth], stack[depth + 1] = first + 1 - larger, first + larger
                depth += 2
                continue
            for block in range(first, first + blocks):
                for place in range(tree.prim_ids.shape[1]):
                    face = tree.prim_ids[block, place]
                    if face == MISS:
                        break
                    met, closed = _met_by_triangle(rows, margin, off, open_blocks, tree.blocks, block, place)
                    open_blocks &= ~closed
                    if met != np.uint64(0):
                        found[count], met_by[count] = face, met
                        count += 1
        needed = 0
        for k in range(count):
            if met_by[k] & open_blocks != np.uint64(0):
                found[needed] = found[k]
                needed += 1
        counts[tile], covered[tile] = needed, ~open_blocks
        start = fetch_add(total_address, needed)
        starts[tile] = start
        if start + needed <= len(kept):
            kept[start : start + needed] = found[:needed]


@kernel
def carry_triangles(counter_address, tree, prisms, kept, starts, counts, vertices, tile_of):  # type: ignore[no-untyped-def]
    """Map the copies of found triangles onto the one tile.

    vertices: (3 N, 3) float32 and tile_of: (N,) int64, written from where a tile's triangles start.
    """
    while True:
        tile = fetch_add(counter_address, 1)
        if tile >= len(counts):
            return
        for copy in range(starts[tile], starts[tile] + counts[tile]):
            tile_of[copy] = tile
            for corner in range(3):
                vertex = tree.faces[kept[copy], corner]
                x, y, z = tree.vertices[vertex, 0], tree.vertices[vertex, 1], tree.vertices[vertex, 2]
                for axis in range(3):
                    row = _row(prisms, tile, axis, 0.0, 1.0)
                    vertices[3 * copy + corner, axis] = _times(row, x, y, z) - row[3]
