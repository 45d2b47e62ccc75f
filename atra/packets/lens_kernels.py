"""The kernel that traces the pixels of a camera with a lens, whose rays are in a table."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel
from atra.embree.layout import RAY_DIR_X
from atra.embree.packets_kernels import intersect, ray_component, set_unlimited
from atra.packets.pixel_kernels import keep_hits


@cache
def lens_kernel(shape_x: int, shape_y: int) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels."""
    width = shape_x * shape_y

    @kernel
    def trace_lens(counter_address, scene, packet, table, tiles, image):  # type: ignore[no-untyped-def]
        """As `trace_pixels`. table: (3, H, W) float32, directions; pixels where they are NaN are misses."""
        height, image_width = image.depth.shape
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            tile_x, tile_y = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            for y0 in range(tile_y, min(tile_y + tiles.height, height), shape_y):
                for x0 in range(tile_x, min(tile_x + tiles.width, image_width), shape_x):
                    columns, rows = min(shape_x, image_width - x0), min(shape_y, height - y0)
                    anyone = False
                    for row in range(shape_y):
                        for column in range(shape_x):
                            lane, x, y = row * shape_x + column, x0 + min(column, columns - 1), y0 + min(row, rows - 1)
                            first = RAY_DIR_X * width + lane
                            has_ray = row < rows and column < columns and not np.isnan(table[0, y, x])
                            packet.valid[lane] = -1 if has_ray else 0
                            anyone |= has_ray
                            for axis in range(3):
                                packet.floats[first + axis * width] = ray_component(table[axis, y, x])
                    set_unlimited(packet, width)
                    if anyone:
                        intersect(width, packet.valid, scene, packet)
                    keep_hits(packet, width, columns, rows, shape_x, x0, y0, image)

    return trace_lens
