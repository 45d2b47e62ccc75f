"""The loops over rays: one ray or packet per pixel, and aligned."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit, types

from atra.embree import layout
from atra.embree.layout import (
    HIT_GEOM_ID,
    HIT_PRIM_ID,
    RAY_DIR_X,
    RAY_ORG_X,
    RAY_TFAR,
    RAY_WORDS,
    RayQueryContext,
)
from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add

_address = types.intp
_intersect1 = types.ExternalFunction("rtcIntersect1", types.void(_address, _address, _address))
_packet_signature = types.void(_address, _address, _address, _address)
_intersect4 = types.ExternalFunction("rtcIntersect4", _packet_signature)
_intersect8 = types.ExternalFunction("rtcIntersect8", _packet_signature)
_intersect16 = types.ExternalFunction("rtcIntersect16", _packet_signature)

_CONTEXT_DEPTH = RayQueryContext.depth_address.offset // 8
_CONTEXT_PRIM_ID = RayQueryContext.prim_id_address.offset // 8
_MISS = np.uint32(layout.INVALID_ID)
_INFINITY = np.float32(np.inf)

TILE_WIDTH, TILE_HEIGHT = 32, 16
"""Pixels of a tile of the per-pixel loop: small enough to share out evenly, large enough to stay in cache."""


SMALLEST_COMPONENT = np.float32(1e-17)
"""Components of a ray that are smaller are 0.

Embree takes the reciprocal of a component below 1e-18 as that of +1e-18, and its packets choose near and far planes by
the sign that the component had before: with a tiny negative one they miss what they should hit. No image shows the
difference: it is that of 1e-17 of a depth.
"""


@njit(inline="always")
def ray_component(of_column, of_row):  # type: ignore[no-untyped-def]
    """A component of a pixel's direction (or origin): the sum of its column's and its row's."""
    total = of_column + of_row
    return total if abs(total) >= SMALLEST_COMPONENT else np.float32(0.0)


@njit(inline="always")
def _intersect(width, valid_address, scene, packet_address, arguments_address):  # type: ignore[no-untyped-def]
    if width == 8:
        _intersect8(valid_address, scene, packet_address, arguments_address)
    elif width == 1:
        _intersect1(scene, packet_address, arguments_address)
    elif width == 4:
        _intersect4(valid_address, scene, packet_address, arguments_address)
    else:
        _intersect16(valid_address, scene, packet_address, arguments_address)


def _varying_fields(width: int, parallel: bool) -> tuple[int, int, int]:
    """Words of a packet from which on stand the x, y and z that differ from ray to ray: direction, or origin."""
    first = RAY_ORG_X if parallel else RAY_DIR_X
    return first * width, (first + 1) * width, (first + 2) * width


@cache
def pixel_kernel(shape_x: int, shape_y: int, parallel: bool = False) -> Callable[..., None]:
    """The per-pixel loop for packets of shape_x x shape_y pixels; the shape is a constant of the compiled code.

    parallel: rays differ in their origin, and share the direction that stands in the packet, instead of the reverse.
    """
    width = shape_x * shape_y
    ray_x, ray_y, ray_z = _varying_fields(width, parallel)
    tfar = RAY_TFAR * width
    hit_prim_id, hit_geom_id = (RAY_WORDS + HIT_PRIM_ID) * width, (RAY_WORDS + HIT_GEOM_ID) * width

    @kernel
    def trace_pixels(  # type: ignore[no-untyped-def]
        counter_address, scene, packet, packet_ids, all_lanes, valid, arguments_address,
        column_rays, row_rays, image_width, height, depth, prim_id,
    ):  # fmt: skip
        """Trace every pixel of an image, tile by tile, until the shared counter runs past the last tile.

        packet, packet_ids: one RTCRayHitK as (words,) float32 and uint32 views of the same memory, its constant fields
        (origin or direction, tnear, mask, flags, inst_id) already set; all_lanes, valid: (K,) int32 masks, all_lanes
        all active. column_rays: (3, >= W) and row_rays: (3, >= H) float32, filled up to whole packets; a pixel's
        direction (or origin) is the sum of its column's and its row's.
        depth, prim_id: (H, W) outputs, written completely.
        """
        packet_address = packet.ctypes.data
        tiles_x = (image_width + TILE_WIDTH - 1) // TILE_WIDTH
        tiles_y = (height + TILE_HEIGHT - 1) // TILE_HEIGHT
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= tiles_x * tiles_y:
                return
            tile_x, tile_y = tile % tiles_x * TILE_WIDTH, tile // tiles_x * TILE_HEIGHT
            for y0 in range(tile_y, min(tile_y + TILE_HEIGHT, height), shape_y):
                for x0 in range(tile_x, min(tile_x + TILE_WIDTH, image_width), shape_x):
                    columns, rows = min(shape_x, image_width - x0), min(shape_y, height - y0)
                    whole = columns == shape_x and rows == shape_y
                    for row in range(shape_y):
                        for column in range(shape_x):
                            lane = row * shape_x + column
                            packet[ray_x + lane] = ray_component(column_rays[0, x0 + column], row_rays[0, y0 + row])
                            packet[ray_y + lane] = ray_component(column_rays[1, x0 + column], row_rays[1, y0 + row])
                            packet[ray_z + lane] = ray_component(column_rays[2, x0 + column], row_rays[2, y0 + row])
                    for lane in range(width):
                        packet[tfar + lane] = _INFINITY
                        packet_ids[hit_prim_id + lane] = _MISS
                        packet_ids[hit_geom_id + lane] = _MISS
                    if whole:
                        _intersect(width, all_lanes.ctypes.data, scene, packet_address, arguments_address)
                        for row in range(shape_y):
                            for column in range(shape_x):
                                lane = row * shape_x + column
                                depth[y0 + row, x0 + column] = packet[tfar + lane]
                                prim_id[y0 + row, x0 + column] = packet_ids[hit_prim_id + lane]
                    else:
                        for lane in range(width):
                            valid[lane] = -1 if lane % shape_x < columns and lane // shape_x < rows else 0
                        _intersect(width, valid.ctypes.data, scene, packet_address, arguments_address)
                        for row in range(rows):
                            for column in range(columns):
                                lane = row * shape_x + column
                                depth[y0 + row, x0 + column] = packet[tfar + lane]
                                prim_id[y0 + row, x0 + column] = packet_ids[hit_prim_id + lane]

    return trace_pixels


@cache
def aligned_kernel(shape_x: int, shape_y: int, parallel: bool = False) -> Callable[..., None]:
    """The aligned loop for packets of shape_x x shape_y pixels; the shape is a constant of the compiled code.

    parallel: as for `pixel_kernel`.
    """
    width = shape_x * shape_y
    ray_x, ray_y, ray_z = _varying_fields(width, parallel)
    tfar = RAY_TFAR * width

    @kernel
    def trace_aligned(  # type: ignore[no-untyped-def]
        counter_address, scene, packet, valid, context, arguments_address, column_rays, row_rays, cell_rows, depth,
        prim_id,
    ):  # fmt: skip
        """Trace the reference cell; the filter writes the pixels of all cells straight into the image.

        Packet and outputs as in `trace_pixels`; context: (words,) int64 view of the extended RTCRayQueryContext.
        column_rays: (3, cell width) and row_rays: (3, cell height) float32, the reference rays. cell_rows: rows of
        cells, those of all images.
        A task is `shape_y` rows of the reference cell, and with them the same rows of every row of cells: no two tasks
        write to the same image row. A packet may reach past the right border of its cell (its spare lanes are inactive
        and rewrite what is there), never past its rows; memory has room for that between the rows of depth and prim_id.
        """
        cell_height, cell_width = row_rays.shape[1], column_rays.shape[1]
        packet_address, valid_address = packet.ctypes.data, valid.ctypes.data
        row_bytes = depth.strides[0]
        while True:
            y0 = fetch_add(counter_address, 1) * shape_y
            if y0 >= cell_height:
                return
            for j in range(cell_rows):
                for row in range(shape_y):
                    depth[j * cell_height + y0 + row, :] = _INFINITY
                    prim_id[j * cell_height + y0 + row, :] = _MISS
            for x0 in range(0, cell_width, shape_x):
                columns = min(shape_x, cell_width - x0)
                for row in range(shape_y):
                    for column in range(shape_x):
                        lane = row * shape_x + column
                        x = x0 + min(column, columns - 1)
                        packet[ray_x + lane] = ray_component(column_rays[0, x], row_rays[0, y0 + row])
                        packet[ray_y + lane] = ray_component(column_rays[1, x], row_rays[1, y0 + row])
                        packet[ray_z + lane] = ray_component(column_rays[2, x], row_rays[2, y0 + row])
                        valid[lane] = -1 if column < columns else 0
                for lane in range(width):
                    packet[tfar + lane] = _INFINITY
                context[_CONTEXT_DEPTH] = depth.ctypes.data + y0 * row_bytes + x0 * 4
                context[_CONTEXT_PRIM_ID] = prim_id.ctypes.data + y0 * row_bytes + x0 * 4
                _intersect(width, valid_address, scene, packet_address, arguments_address)

    return trace_aligned
