"""The kernel that traces packets for a gathering filter, over pixels or reference rays."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel
from atra.embree.layout import RAY_TFAR, RayQueryContext
from atra.embree.packets_kernels import INFINITY, intersect, set_pixel_ray

_FIRST_PIXEL = RayQueryContext.first_pixel.offset // 8


@cache
def shooting_kernel(shape_x: int, shape_y: int, parallel: bool) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels. parallel: rays share a direction but not an origin."""
    width = shape_x * shape_y

    @kernel
    def shoot(counter_address, scene, packet, rays, tiles, image_width, image_height, row):  # type: ignore[no-untyped-def]
        """Trace the rays of an image, tile by tile; threads share the counter.

        rays: padded to whole packets. tiles: `PixelTiles`; no packet meets two of them. row: pixels from one row of the
        target to the next. The filter writes to the target, and rewrites pixels beyond the image's right and lower
        border, for which the target has room.
        """
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            left, top = int(tiles.corners[tile, 0]), int(tiles.corners[tile, 1])
            right, bottom = min(left + tiles.width, image_width), min(top + tiles.height, image_height)
            for y0 in range(top, bottom, shape_y):
                for x0 in range(left, right, shape_x):
                    columns, rows = min(shape_x, right - x0), min(shape_y, bottom - y0)
                    for lane in range(width):
                        column, line = lane % shape_x, lane // shape_x
                        x, y = x0 + min(column, columns - 1), y0 + min(line, rows - 1)
                        set_pixel_ray(packet, width, lane, parallel, rays, x, y)
                        packet.valid[lane] = -1 if column < columns and line < rows else 0
                        packet.floats[RAY_TFAR * width + lane] = INFINITY
                    packet.context[_FIRST_PIXEL] = y0 * row + x0
                    intersect(width, packet.valid, scene, packet)

    return shoot
