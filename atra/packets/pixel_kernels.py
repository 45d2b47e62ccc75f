"""Kernels that trace the pixels of an image in single rays or packets."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.embree.packets_kernels import hit_distance, hit_prim_id, intersect, set_pixel_ray, set_unlimited


@njit(forceinline=True)
def keep_hits(packet, width, columns, rows, shape_x, x0, y0, image):  # type: ignore[no-untyped-def]
    """Store the hits of a packet whose first pixel is (x0, y0), as far as `columns` and `rows` reach."""
    for row in range(rows):
        for column in range(columns):
            lane = row * shape_x + column
            image.depth[y0 + row, x0 + column] = hit_distance(packet, width, lane)
            image.prim_id[y0 + row, x0 + column] = hit_prim_id(packet, width, lane)


@cache
def pixel_kernel(shape_x: int, shape_y: int, parallel: bool = False) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels. parallel: rays share a direction but not an origin."""
    width = shape_x * shape_y

    @kernel
    def trace_pixels(counter_address, scene, packet, rays, tiles, image):  # type: ignore[no-untyped-def]
        """Trace every pixel of an image, tile by tile; threads share the counter.

        packet: with its constant fields set (origin or direction, tnear, mask, flags, inst_id). rays: padded to whole
        packets. tiles: `PixelTiles` that cover the image. image: written completely.
        """
        height, image_width = image.depth.shape
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            tile_x, tile_y = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            for y0 in range(tile_y, min(tile_y + tiles.height, height), shape_y):
                for x0 in range(tile_x, min(tile_x + tiles.width, image_width), shape_x):
                    columns, rows = min(shape_x, image_width - x0), min(shape_y, height - y0)
                    whole = columns == shape_x and rows == shape_y
                    for row in range(shape_y):
                        for column in range(shape_x):
                            set_pixel_ray(packet, width, row * shape_x + column, parallel, rays, x0 + column, y0 + row)
                    set_unlimited(packet, width)
                    if whole:
                        intersect(width, packet.all_lanes, scene, packet)
                        keep_hits(packet, width, shape_x, shape_y, shape_x, x0, y0, image)
                    else:
                        for lane in range(width):
                            packet.valid[lane] = -1 if lane % shape_x < columns and lane // shape_x < rows else 0
                        intersect(width, packet.valid, scene, packet)
                        keep_hits(packet, width, columns, rows, shape_x, x0, y0, image)

    return trace_pixels
