"""The loop over the pixels of an image, in single rays or packets, through a BVH of ours."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.kernels.bvh.layout import ROOT
from atra.kernels.bvh.packets import (
    DIRECTION_X,
    INVERSE_X,
    PRIM_ID,
    TFAR,
    TNEAR,
    X,
    nearest_of_packet,
)
from atra.kernels.bvh.single import nearest, reciprocal
from atra.kernels.caching import float_kernel
from atra.kernels.gathering.lanes import uint32_at
from atra.kernels.intrinsics import fetch_add, float_at
from atra.kernels.packets import INFINITY, ray_component
from atra.kernels.shafts.grid import list_of, push_list, shaft_of

_ZERO = np.float32(0.0)


@njit(inline="always")
def pixel_ray(parallel, rays, shared, x, y):  # type: ignore[no-untyped-def]
    """Origin, direction and tnear of the ray of pixel (x, y)."""
    a = ray_component(rays.columns[0, x] + rays.rows[0, y])
    b = ray_component(rays.columns[1, x] + rays.rows[1, y])
    c = ray_component(rays.columns[2, x] + rays.rows[2, y])
    if parallel:
        return (a, b, c, shared[0], shared[1], shared[2], _ZERO)
    return (_ZERO, _ZERO, _ZERO, a, b, c, _ZERO)


@njit(inline="always")
def set_ray(bundle, lane, ray, tfar):  # type: ignore[no-untyped-def]
    """A ray into a lane of a bundle."""
    x, y, z, dx, dy, dz, tnear = ray
    bundle[X, lane], bundle[X + 1, lane], bundle[X + 2, lane] = x, y, z
    bundle[DIRECTION_X, lane], bundle[DIRECTION_X + 1, lane], bundle[DIRECTION_X + 2, lane] = dx, dy, dz
    bundle[INVERSE_X, lane], bundle[INVERSE_X + 1, lane] = reciprocal(dx), reciprocal(dy)
    bundle[INVERSE_X + 2, lane] = reciprocal(dz)
    bundle[TNEAR, lane], bundle[TFAR, lane] = tnear, tfar


@njit(inline="always")
def hit_of(bundle, width, lane):  # type: ignore[no-untyped-def]
    """(t, prim_id) that a lane of a bundle holds."""
    address = bundle.ctypes.data + 4 * lane
    return float_at(address + 4 * width * TFAR), uint32_at(address + 4 * width * PRIM_ID)


@cache
def image_kernel(
    shape_x: int, shape_y: int, push: bool, counting: bool, parallel: bool, seeded: bool
) -> Callable[..., None]:
    """The loop for packets of shape_x x shape_y pixels; push, counting: see `atra.kernels.bvh.single.nearest`.

    parallel: rays differ in their origins and share a direction, instead of the reverse. seeded: single rays start from
    the lists of shafts.
    """
    width = shape_x * shape_y

    @float_kernel
    def trace_pixels(counter_address, tree, rays, shared, tiles, image, shafts, memory):  # type: ignore[no-untyped-def]
        """Trace every pixel, tile by tile, until the shared counter runs past the last tile.

        tree: `Tree`. rays: `RayGrid`, filled up to whole packets. shared: (3,) float32, the direction of parallel rays.
        tiles: `PixelTiles`. image: written completely. shafts: `Shafts`. memory: this thread's own.
        """
        image_height, image_width = image.depth.shape
        stack, nears, counts, bundle = memory.stack, memory.nears, memory.counts, memory.bundle
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            left, top = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            right, bottom = min(left + tiles.width, image_width), min(top + tiles.height, image_height)
            for y0 in range(top, bottom, shape_y):
                for x0 in range(left, right, shape_x):
                    stack[0] = ROOT
                    if width == 1:
                        ray = pixel_ray(parallel, rays, shared, x0, y0)
                        size = 1
                        if seeded:
                            start = list_of(shafts, shaft_of(shafts.grid, ray))
                            size = push_list(shafts, start, stack, counting, counts)
                        t, prim_id = nearest(push, False, counting, tree, ray, INFINITY, stack, nears, size, counts)
                        image.depth[y0, x0], image.prim_id[y0, x0] = t, prim_id
                        continue
                    for lane in range(width):
                        x, y = x0 + lane % shape_x, y0 + lane // shape_x
                        tfar = INFINITY if x < right and y < bottom else -INFINITY
                        set_ray(bundle, lane, pixel_ray(parallel, rays, shared, x, y), tfar)
                    ways = memory.ways.ctypes.data
                    nearest_of_packet(
                        width, push, False, counting, tree, bundle.ctypes.data, stack, ways, 1, counts
                    )  # fmt: skip
                    for lane in range(width):
                        x, y = x0 + lane % shape_x, y0 + lane // shape_x
                        if x < right and y < bottom:
                            image.depth[y, x], image.prim_id[y, x] = hit_of(bundle, width, lane)

    return trace_pixels
