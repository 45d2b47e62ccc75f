"""Packets per pixel that keep where on the triangles Embree's hits lie."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel
from atra.embree.layout import HIT_NG_X, HIT_U, HIT_V, RAY_WORDS
from atra.embree.packets_kernels import intersect, set_pixel_ray, set_unlimited
from atra.packets.loop_kernels import keep_hits


class Surface(NamedTuple):
    """Where on the triangles Embree's hits lie. u, v: (H, W) float32. normal: (H, W, 3) float32, ray space, any
    length."""

    u: NDArray[np.float32]
    v: NDArray[np.float32]
    normal: NDArray[np.float32]


@cache
def surface_kernel(shape_x: int, shape_y: int) -> Callable[..., None]:
    """As `packet_kernel` of `atra.packets`, and it keeps where on the triangles the hits lie."""
    width = shape_x * shape_y

    @kernel
    def trace_surface(counter_address, scene, packet, rays, tiles, image, surface):  # type: ignore[no-untyped-def]
        """As `trace_packets`. surface: `Surface`, written completely; undefined where nothing is hit."""
        height, image_width = image.depth.shape
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            tile_x, tile_y = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            for y0 in range(tile_y, min(tile_y + tiles.height, height), shape_y):
                for x0 in range(tile_x, min(tile_x + tiles.width, image_width), shape_x):
                    columns, rows = min(shape_x, image_width - x0), min(shape_y, height - y0)
                    for row in range(shape_y):
                        for column in range(shape_x):
                            lane = row * shape_x + column
                            set_pixel_ray(packet, width, lane, False, rays, x0 + column, y0 + row)
                            packet.valid[lane] = -1 if row < rows and column < columns else 0
                    set_unlimited(packet, width)
                    intersect(width, packet.valid, scene, packet)
                    keep_hits(packet, width, columns, rows, shape_x, x0, y0, image)
                    for row in range(rows):
                        for column in range(columns):
                            lane, y, x = row * shape_x + column, y0 + row, x0 + column
                            surface.u[y, x] = packet.floats[(RAY_WORDS + HIT_U) * width + lane]
                            surface.v[y, x] = packet.floats[(RAY_WORDS + HIT_V) * width + lane]
                            for axis in range(3):
                                word = (RAY_WORDS + HIT_NG_X + axis) * width + lane
                                surface.normal[y, x, axis] = packet.floats[word]

    return trace_surface
