"""Kernels of aligned tracing: the pass over the reference rays, and the second pass for what the first left out."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel
from atra.embree.layout import HIT_GEOM_ID, HIT_PRIM_ID, RAY_TFAR, RAY_TNEAR, RAY_WORDS, RayQueryContext
from atra.embree.packets_kernels import INFINITY, MISS, START, intersect, set_pixel_ray
from atra.packets.pixel_kernels import keep_hits

_CONTEXT_DEPTH = RayQueryContext.depth_address.offset // 8
_CONTEXT_PRIM_ID = RayQueryContext.prim_id_address.offset // 8


@cache
def verify_kernel(shape_x: int, shape_y: int, parallel: bool = False) -> Callable[..., None]:
    """The second pass for packets of shape_x x shape_y pixels. parallel: as for `aligned_kernel`."""
    width = shape_x * shape_y
    tnear, tfar = RAY_TNEAR * width, RAY_TFAR * width
    prim_word, geom_word = (RAY_WORDS + HIT_PRIM_ID) * width, (RAY_WORDS + HIT_GEOM_ID) * width

    @kernel
    def verify_pixels(counter_address, scene, packet, rays, nearest, grid, image, traced):  # type: ignore[no-untyped-def]
        """Trace again where something left out of the first pass may lie in front of its hits.

        Each ray covers the stretch from the tile's depth in `nearest` to the hit found. Packet and rays as in
        `trace_pixels`. nearest: (tile rows, tile columns) float32, no ray of a tile meets what was left out before this
        depth; inf = never. grid: `TileGrid`, of whole packets. image: the first pass's, updated with nearer hits.
        traced: (1,) int64, this thread's count of packets.
        """
        floats, ids = packet.floats, packet.ids
        depth, prim_id = image.depth, image.prim_id
        tile_w, tile_h = grid.tile_width, grid.tile_height
        height, image_width = depth.shape
        while True:
            ty = fetch_add(counter_address, 1)
            if ty >= nearest.shape[0]:
                for lane in range(width):
                    floats[tnear + lane] = START  # other kernels expect this
                return
            for y0 in range(ty * tile_h, min((ty + 1) * tile_h, height), shape_y):
                rows = min(shape_y, height - y0)
                for tx in range(nearest.shape[1]):
                    limit = nearest[ty, tx]
                    if limit == np.inf:
                        continue
                    for x0 in range(tx * tile_w, min((tx + 1) * tile_w, image_width), shape_x):
                        columns = min(shape_x, image_width - x0)
                        farthest = np.float32(0.0)
                        if columns == shape_x and rows == shape_y:
                            for row in range(shape_y):
                                for column in range(shape_x):
                                    farthest = max(farthest, depth[y0 + row, x0 + column])
                        else:
                            for row in range(rows):
                                for column in range(columns):
                                    farthest = max(farthest, depth[y0 + row, x0 + column])
                        if farthest < limit:
                            continue
                        traced[0] += 1
                        for row in range(shape_y):
                            for column in range(shape_x):
                                lane = row * shape_x + column
                                x, y = x0 + min(column, columns - 1), y0 + min(row, rows - 1)
                                set_pixel_ray(packet, width, lane, parallel, rays, x, y)
                                floats[tnear + lane] = max(limit, START)
                                floats[tfar + lane] = depth[y, x]
                                ids[prim_word + lane] = prim_id[y, x]
                                ids[geom_word + lane] = MISS
                                is_open = row < rows and column < columns and depth[y, x] >= limit
                                packet.valid[lane] = -1 if is_open else 0
                        intersect(width, packet.valid, scene, packet)
                        keep_hits(packet, width, columns, rows, shape_x, x0, y0, image)

    return verify_pixels


@cache
def aligned_kernel(shape_x: int, shape_y: int, parallel: bool = False) -> Callable[..., None]:
    """The aligned pass for packets of shape_x x shape_y pixels. parallel: rays share a direction and differ in their
    origins."""
    width = shape_x * shape_y

    @kernel
    def trace_aligned(counter_address, scene, packet, rays, cell_rows, image):  # type: ignore[no-untyped-def]
        """Trace the reference cell's rays; the filter writes the pixels of all cells into the image.

        packet: with its constant fields set (origin or direction, tnear, flags, inst_id). rays: the reference rays of
        one cell. cell_rows: rows of cells, of all images together. image: written completely. A task is `shape_y` rows
        of the reference cell and the same rows of every row of cells, so no two tasks write one image row. A packet may
        reach past its cell's right border: those lanes are inactive and rewrite what is there, and image rows have room
        for them.
        """
        depth, prim_id = image.depth, image.prim_id
        cell_height, cell_width = rays.rows.shape[1], rays.columns.shape[1]
        row_bytes = depth.strides[0]
        while True:
            y0 = fetch_add(counter_address, 1) * shape_y
            if y0 >= cell_height:
                return
            for j in range(cell_rows):
                for row in range(shape_y):
                    depth[j * cell_height + y0 + row, :] = INFINITY
                    prim_id[j * cell_height + y0 + row, :] = MISS
            for x0 in range(0, cell_width, shape_x):
                columns = min(shape_x, cell_width - x0)
                for row in range(shape_y):
                    for column in range(shape_x):
                        lane = row * shape_x + column
                        set_pixel_ray(packet, width, lane, parallel, rays, x0 + min(column, columns - 1), y0 + row)
                        packet.valid[lane] = -1 if column < columns else 0
                for lane in range(width):
                    packet.floats[RAY_TFAR * width + lane] = INFINITY
                packet.context[_CONTEXT_DEPTH] = depth.ctypes.data + y0 * row_bytes + x0 * 4
                packet.context[_CONTEXT_PRIM_ID] = prim_id.ctypes.data + y0 * row_bytes + x0 * 4
                intersect(width, packet.valid, scene, packet)

    return trace_aligned
