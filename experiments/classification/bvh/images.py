"""The kernel that traces the pixels of an image through the BVH, in single rays or packets."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add, float_at, uint32_at
from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY, MISS, ray_component
from experiments.classification.bvh.memory import AHEAD
from experiments.classification.bvh.packets import DIRECTION_X, INVERSE_X, PRIM_ID, TFAR, TNEAR, X, nearest_of_packet
from experiments.classification.bvh.single import nearest, reciprocal
from experiments.classification.bvh.starts import ROOT_LIST, count_start, fetch_list, find_shafts, list_of, set_ahead

_ZERO = np.float32(0.0)


class Start(Enum):
    """Where the rays of an image start: at the root; single rays at their shaft's list; or all rays of a tile at the
    tile's list, table[0, tile] of `Shafts`."""

    root = "root"
    shaft = "shaft"
    tile = "tile"


@njit(forceinline=True)
def pixel_ray(parallel, placed, rays, shared, x, y):  # type: ignore[no-untyped-def]
    """Origin, direction and tnear of pixel (x, y)'s ray. placed: pinhole rays start at the eye `shared`, not at 0."""
    a = ray_component(rays.columns[0, x] + rays.rows[0, y])
    b = ray_component(rays.columns[1, x] + rays.rows[1, y])
    c = ray_component(rays.columns[2, x] + rays.rows[2, y])
    if parallel:
        return (a, b, c, shared[0], shared[1], shared[2], _ZERO)
    if placed:
        return (shared[0], shared[1], shared[2], a, b, c, _ZERO)
    return (_ZERO, _ZERO, _ZERO, a, b, c, _ZERO)


@njit(forceinline=True)
def set_ray(bundle, lane, ray, tfar):  # type: ignore[no-untyped-def]
    """Write a ray into a lane of a bundle."""
    x, y, z, dx, dy, dz, tnear = ray
    bundle[X, lane], bundle[X + 1, lane], bundle[X + 2, lane] = x, y, z
    bundle[DIRECTION_X, lane], bundle[DIRECTION_X + 1, lane], bundle[DIRECTION_X + 2, lane] = dx, dy, dz
    bundle[INVERSE_X, lane], bundle[INVERSE_X + 1, lane] = reciprocal(dx), reciprocal(dy)
    bundle[INVERSE_X + 2, lane] = reciprocal(dz)
    bundle[TNEAR, lane], bundle[TFAR, lane] = tnear, tfar


@njit(forceinline=True)
def hit_of(bundle, width, lane):  # type: ignore[no-untyped-def]
    """(t, prim_id) in a lane of a bundle."""
    address = bundle.ctypes.data + 4 * lane
    return float_at(address + 4 * width * TFAR), uint32_at(address + 4 * width * PRIM_ID)


@cache
def image_kernel(
    shape_x: int, shape_y: int, push: bool, counting: bool, robust: bool, parallel: bool, start: Start
) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels. push, counting, robust: see `bvh.single.nearest`.

    parallel: rays share a direction and differ in their origins. start: where rays start.
    """
    width, seeded, tiled = shape_x * shape_y, start is Start.shaft, start is Start.tile

    @float_kernel
    def trace_pixels(counter_address, tree, rays, shared, tiles, image, shafts, memory):  # type: ignore[no-untyped-def]
        """Trace every pixel, tile by tile; threads share the counter.

        rays: `RayGrid`, padded to whole packets. shared: (3,) float32, the direction of parallel rays, or the eye for
        lists of tiles. tiles: `PixelTiles`. image: written completely. shafts: `Shafts`. memory: this thread's.
        """
        image_height, image_width = image.depth.shape
        stack, nears, counts, bundle = memory.stack, memory.nears, memory.counts, memory.bundle
        lists, starts = shafts.lists, memory.starts
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            left, top = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            first = np.int64(shafts.table[0, tile] if tiled else ROOT_LIST)
            right, bottom = min(left + tiles.width, image_width), min(top + tiles.height, image_height)
            for y0 in range(top, bottom, shape_y):
                for x0 in range(left, right, shape_x):
                    if width == 1:
                        ray = pixel_ray(parallel, tiled, rays, shared, x0, y0)
                        place = first
                        if seeded:
                            if (x0 - left) % AHEAD == 0:
                                coming = min(AHEAD, right - x0)
                                for k in range(coming):
                                    set_ahead(memory.ahead, k, pixel_ray(parallel, tiled, rays, shared, x0 + k, y0))
                                find_shafts(shafts.grid, memory.ahead)
                                for k in range(coming):
                                    starts[k] = list_of(shafts, memory.ahead, k)
                                    fetch_list(tree, lists, starts[k])
                            place = starts[(x0 - left) % AHEAD]
                        if (seeded or tiled) and counting:
                            count_start(place, counts)
                        t, prim_id = nearest(
                            push, False, counting, robust, tree, ray, INFINITY, lists, place, stack, nears, counts
                        )  # fmt: skip
                        image.depth[y0, x0], image.prim_id[y0, x0] = t, prim_id
                        continue
                    if tiled and counting:
                        count_start(first, counts)
                    for lane in range(width):
                        x, y = x0 + lane % shape_x, y0 + lane // shape_x
                        tfar = INFINITY if x < right and y < bottom else -INFINITY
                        set_ray(bundle, lane, pixel_ray(parallel, tiled, rays, shared, x, y), tfar)
                    ways = memory.ways.ctypes.data
                    nearest_of_packet(
                        width, push, False, counting, robust, tree, bundle.ctypes.data, lists, first, stack, ways,
                        counts,
                    )  # fmt: skip
                    for lane in range(width):
                        x, y = x0 + lane % shape_x, y0 + lane // shape_x
                        if x < right and y < bottom:
                            image.depth[y, x], image.prim_id[y, x] = hit_of(bundle, width, lane)

    return trace_pixels


@njit(forceinline=True)
def _table_ray(table, x, y):  # type: ignore[no-untyped-def]
    """Origin, direction and tnear of pixel (x, y)'s ray."""
    a, b, c = ray_component(table[0, y, x]), ray_component(table[1, y, x]), ray_component(table[2, y, x])
    return (_ZERO, _ZERO, _ZERO, a, b, c, _ZERO)


@cache
def lens_kernel(shape_x: int, shape_y: int, push: bool, counting: bool, robust: bool) -> Callable[..., None]:
    """The kernel for packets of shape_x x shape_y pixels. push, counting, robust: see `bvh.single.nearest`."""
    width = shape_x * shape_y

    @float_kernel
    def trace_lens(counter_address, tree, table, lists, tiles, image, memory):  # type: ignore[no-untyped-def]
        """As `trace_pixels` of `image_kernel`. table: (3, H, W) float32, directions; pixels where they are NaN are
        misses. lists: `NO_LISTS`."""
        height, image_width = image.depth.shape
        stack, nears, counts, bundle = memory.stack, memory.nears, memory.counts, memory.bundle
        while True:
            tile = fetch_add(counter_address, 1)
            if tile >= len(tiles.corners):
                return
            left, top = np.int64(tiles.corners[tile, 0]), np.int64(tiles.corners[tile, 1])
            right, bottom = min(left + tiles.width, image_width), min(top + tiles.height, height)
            for y0 in range(top, bottom, shape_y):
                for x0 in range(left, right, shape_x):
                    if width == 1:
                        t, prim_id = INFINITY, MISS
                        if not np.isnan(table[0, y0, x0]):
                            t, prim_id = nearest(
                                push, False, counting, robust, tree, _table_ray(table, x0, y0), INFINITY, lists,
                                ROOT_LIST, stack, nears, counts,
                            )  # fmt: skip
                        image.depth[y0, x0], image.prim_id[y0, x0] = t, prim_id
                        continue
                    for lane in range(width):
                        x, y = min(x0 + lane % shape_x, right - 1), min(y0 + lane // shape_x, bottom - 1)
                        is_own = x == x0 + lane % shape_x and y == y0 + lane // shape_x
                        has_ray = is_own and not np.isnan(table[0, y, x])
                        set_ray(bundle, lane, _table_ray(table, x, y), INFINITY if has_ray else -INFINITY)
                    ways = memory.ways.ctypes.data
                    nearest_of_packet(
                        width, push, False, counting, robust, tree, bundle.ctypes.data, lists, ROOT_LIST, stack, ways,
                        counts,
                    )  # fmt: skip
                    for lane in range(width):
                        x, y = x0 + lane % shape_x, y0 + lane // shape_x
                        if x < right and y < bottom:
                            t, prim_id = hit_of(bundle, width, lane)
                            image.depth[y, x] = t if t >= _ZERO else INFINITY
                            image.prim_id[y, x] = prim_id

    return trace_lens
