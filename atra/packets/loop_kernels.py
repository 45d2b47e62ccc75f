"""The packet loop: it traces the rays of tiles of pixels in packets, for every method on Embree."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.embree.layout import HIT_GEOM_ID, HIT_PRIM_ID, RAY_DIR_X, RAY_TFAR, RAY_TNEAR, RAY_WORDS, RayQueryContext
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    START,
    hit_distance,
    hit_prim_id,
    intersect,
    ray_component,
    set_pixel_ray,
    set_unlimited,
)

NEAREST, NEAREST_OF_TABLE, NEARER, FILTERED = range(4)
"""What is traced. The nearest hits of a `RayGrid`, or of a table of directions, are stored. NEARER: hits replace those
of an image where they are nearer; a tile's rays start at its limit. FILTERED: Embree's filter takes the hits."""

_TILES_AT_ONCE = 64
"""Tiles that a thread takes at a time where most packets are skipped."""

_FIRST_PIXEL = RayQueryContext.first_pixel.offset // 8
_DEPTH = RayQueryContext.depth_address.offset // 8
_PRIM_ID = RayQueryContext.prim_id_address.offset // 8


class Limits(NamedTuple):
    """Limits of NEARER. nearest: (tiles,) float32, no ray of a tile meets the scene before this depth. traced:
    (1,) int64, this thread's count of packets."""

    nearest: NDArray[np.float32]
    traced: NDArray[np.int64]


@njit(forceinline=True)
def keep_hits(packet, width, columns, rows, shape_x, x0, y0, image):  # type: ignore[no-untyped-def]
    """Store the hits of a packet whose first pixel is (x0, y0), as far as `columns` and `rows` reach."""
    for row in range(rows):
        for column in range(columns):
            lane = row * shape_x + column
            image.depth[y0 + row, x0 + column] = hit_distance(packet, width, lane)
            image.prim_id[y0 + row, x0 + column] = hit_prim_id(packet, width, lane)


@njit(forceinline=True)
def _set_table_rays(packet, width, shape_x, columns, rows, x0, y0, table):  # type: ignore[no-untyped-def]
    """Store directions of a table, (3, H, W) float32, and make lanes inactive where they are NaN. Returns whether any
    lane is active."""
    is_any = False
    for lane in range(width):
        column, row = lane % shape_x, lane // shape_x
        x, y = x0 + min(column, columns - 1), y0 + min(row, rows - 1)
        has_ray = row < rows and column < columns and not np.isnan(table[0, y, x])
        packet.valid[lane] = -1 if has_ray else 0
        is_any |= has_ray
        for axis in range(3):
            packet.floats[(RAY_DIR_X + axis) * width + lane] = ray_component(table[axis, y, x])
    return is_any


@njit(forceinline=True)
def _farthest(depth, columns, rows, x0, y0):  # type: ignore[no-untyped-def]
    """The farthest hit of a packet's pixels."""
    farthest = np.float32(0.0)
    for row in range(rows):
        for column in range(columns):
            farthest = max(farthest, depth[y0 + row, x0 + column])
    return farthest


@njit(forceinline=True)
def _continue_rays(packet, width, shape_x, columns, rows, x0, y0, image, nearest):  # type: ignore[no-untyped-def]
    """Let rays reach from a depth to the hits of an image; lanes whose hits are nearer become inactive."""
    for lane in range(width):
        column, row = lane % shape_x, lane // shape_x
        x, y = x0 + min(column, columns - 1), y0 + min(row, rows - 1)
        packet.floats[RAY_TNEAR * width + lane] = max(nearest, START)
        packet.floats[RAY_TFAR * width + lane] = image.depth[y, x]
        packet.ids[(RAY_WORDS + HIT_PRIM_ID) * width + lane] = image.prim_id[y, x]
        packet.ids[(RAY_WORDS + HIT_GEOM_ID) * width + lane] = MISS
        is_open = row < rows and column < columns and image.depth[y, x] >= nearest
        packet.valid[lane] = -1 if is_open else 0


@cache
def packet_kernel(shape_x: int, shape_y: int, kind: int = NEAREST, parallel: bool = False) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels. kind: NEAREST or another. parallel: rays share a direction
    but not an origin."""
    width, at_once = shape_x * shape_y, _TILES_AT_ONCE if kind == NEARER else 1
    is_table, is_nearer, is_filtered = kind == NEAREST_OF_TABLE, kind == NEARER, kind == FILTERED

    @kernel
    def trace_packets(counter_address, scene, packet, rays, tiles, size, row_stride, cell_rows, image, limits):  # type: ignore[no-untyped-def]
        """Trace the rays of pixels tile by tile; threads share the counter.

        packet: with its constant fields set (origin or direction, tnear, mask, flags, inst_id). rays: a `RayGrid` that
        reaches to whole packets, or a table of directions, (3, H, W) float32, NaN where there is no ray. tiles:
        `PixelTiles`; no packet meets two of them. size: width and height, pixels that the tiles cover. image: written.
        limits: `Limits` of NEARER.

        FILTERED: the filter writes pixels `row_stride` apart from row to row, also in place of inactive lanes past the
        border. Tiles are rows of a cell; the same rows of `cell_rows` rows of cells are cleared in the image first.
        """
        while True:
            first = fetch_add(counter_address, 1) * at_once
            if first >= len(tiles.corners):
                if is_nearer:
                    for lane in range(width):
                        packet.floats[RAY_TNEAR * width + lane] = START  # other kernels expect this
                return
            for tile in range(first, min(first + at_once, len(tiles.corners))):
                left, top = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
                right, bottom = min(left + tiles.width, size[0]), min(top + tiles.height, size[1])
                if is_filtered:
                    for j in range(cell_rows):
                        for y in range(j * size[1] + top, j * size[1] + bottom):
                            image.depth[y, :] = INFINITY
                            image.prim_id[y, :] = MISS
                for y0 in range(top, bottom, shape_y):
                    for x0 in range(left, right, shape_x):
                        columns, rows = min(shape_x, right - x0), min(shape_y, bottom - y0)
                        is_whole = columns == shape_x and rows == shape_y
                        if is_nearer:
                            nearest = limits.nearest[tile]
                            if is_whole:
                                farthest = _farthest(image.depth, shape_x, shape_y, x0, y0)
                            else:
                                farthest = _farthest(image.depth, columns, rows, x0, y0)
                            if farthest < nearest:
                                continue
                            limits.traced[0] += 1
                        has_rays = True
                        if is_table:
                            has_rays = _set_table_rays(packet, width, shape_x, columns, rows, x0, y0, rays)
                        else:
                            for row in range(shape_y):
                                for column in range(shape_x):
                                    lane = row * shape_x + column
                                    set_pixel_ray(packet, width, lane, parallel, rays, x0 + column, y0 + row)
                        # Limits follow the rays: the other way round, an image of packets takes 3 % longer.
                        if is_nearer:
                            _continue_rays(packet, width, shape_x, columns, rows, x0, y0, image, nearest)
                        elif is_filtered:
                            for lane in range(width):
                                packet.floats[RAY_TFAR * width + lane] = INFINITY
                            pixel = y0 * row_stride + x0
                            packet.context[_FIRST_PIXEL] = pixel
                            packet.context[_DEPTH] = image.depth.ctypes.data + 4 * pixel
                            packet.context[_PRIM_ID] = image.prim_id.ctypes.data + 4 * pixel
                        else:
                            set_unlimited(packet, width)
                        if is_whole and not is_table and not is_nearer:
                            intersect(width, packet.all_lanes, scene, packet)
                            if not is_filtered:
                                keep_hits(packet, width, shape_x, shape_y, shape_x, x0, y0, image)
                            continue
                        if not is_table and not is_nearer:
                            for lane in range(width):
                                is_inside = lane % shape_x < columns and lane // shape_x < rows
                                packet.valid[lane] = -1 if is_inside else 0
                        if has_rays:
                            intersect(width, packet.valid, scene, packet)
                        if not is_filtered:
                            keep_hits(packet, width, columns, rows, shape_x, x0, y0, image)

    return trace_packets
