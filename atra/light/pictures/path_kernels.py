"""Kernels of path tracing: a wave of paths, stage by stage, or one path after the other."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.layout import RAY_DIR_X, RAY_ORG_X, RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import INFINITY, MISS, START, hit_prim_id, intersect, ray_component, set_no_hit
from atra.light.numbers_kernels import bits_of, key_of, set_vector, unit, unit_of, vector
from atra.light.scattering_kernels import WHITE, emitted, scatter
from atra.light.surface_kernels import sky_colour

BLOCK = 2048
"""Rays compacted together. Packets stay within a block, which starts at a multiple of BLOCK pixels; so a ray has the
same packet, and Embree's answer the same bits, for any size of wave."""

TILE = 4
"""Side of the tiles in which pixels are taken; a packet's rays then start close together."""

ORIGIN, DIRECTION, WEIGHT = 0, 3, 6
PATH_ROWS = 9

ROW_PADDING = 80
"""Extra columns of a wave; rows a power of two apart would compete for the same cache sets."""

_JITTER = np.uint32(0xFFFFFFFE)
"""First of two random dimensions of a pixel's own jitter; those of bounces count from 0."""


class Paths(NamedTuple):
    """A wave of N paths, in blocks of BLOCK. The first `counts` paths of each block continue.

    floats: (PATH_ROWS, N) float32: origin, unit direction, weight (r, g, b), three rows each. prim_id: (N,) uint32,
    hits. pixel: (N,) int32. counts: (blocks,) int64.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    pixel: NDArray[np.int32]
    counts: NDArray[np.int64]


class Pixels(NamedTuple):
    """Rays of the pixels of an image, and their hits.

    lines: (6, 3) float64, world space: origin and direction of pixel (0, 0)'s ray, then their change per pixel to the
    right, then per pixel down. places: (pixels,) uint32, x + y 2^16 of each pixel, in the order of work. jittered:
    whether each pixel has an offset of its own. prim_id: (>= pixels,) uint32, image rows `stride` apart; empty if rays
    are still to be traced. sample_key: uint32. directions: (3, H, W) float32, world space, of a camera with a lens, in
    place of those of `lines`; (3, 0, 0) without.
    """

    lines: NDArray[np.float64]
    places: NDArray[np.uint32]
    jittered: bool
    prim_id: NDArray[np.uint32]
    stride: int
    sample_key: int
    directions: NDArray[np.float32]


@njit(forceinline=True)
def place_of(pixels, pixel):  # type: ignore[no-untyped-def]
    """(x, y) of a pixel."""
    place = pixels.places[pixel]
    return np.int64(place & np.uint32(0xFFFF)), np.int64(place >> np.uint32(16))


@njit(forceinline=True)
def seen_by(pixels, pixel):  # type: ignore[no-untyped-def]
    """The prim_id that a pixel sees."""
    x, y = place_of(pixels, pixel)
    return pixels.prim_id[y * pixels.stride + x]


@njit(forceinline=True)
def pixel_line(pixels, pixel):  # type: ignore[no-untyped-def]
    """(origin, direction), float32, of a pixel's ray; the direction is not normalised."""
    column, row = place_of(pixels, pixel)
    x, y = np.float64(column), np.float64(row)
    if pixels.directions.shape[1] > 0:
        origin, _ = line_at(pixels.lines, x, y)
        ways = pixels.directions
        return origin, (ways[0, row, column], ways[1, row, column], ways[2, row, column])
    if pixels.jittered:
        key = key_of(pixel, pixels.sample_key)
        x += unit_of(bits_of(key, _JITTER))
        y += unit_of(bits_of(key, _JITTER + np.uint32(1)))
    return line_at(pixels.lines, x, y)


@njit(forceinline=True)
def line_at(lines, x, y):  # type: ignore[no-untyped-def]
    """As `pixel_line`, at a float64 position."""
    origin = (
        np.float32(lines[0, 0] + x * lines[2, 0] + y * lines[4, 0]),
        np.float32(lines[0, 1] + x * lines[2, 1] + y * lines[4, 1]),
        np.float32(lines[0, 2] + x * lines[2, 2] + y * lines[4, 2]),
    )
    direction = (
        np.float32(lines[1, 0] + x * lines[3, 0] + y * lines[5, 0]),
        np.float32(lines[1, 1] + x * lines[3, 1] + y * lines[5, 1]),
        np.float32(lines[1, 2] + x * lines[3, 2] + y * lines[5, 2]),
    )
    return origin, direction


@float_kernel
def generate(paths, first, count, pixels):  # type: ignore[no-untyped-def]
    """Stage 1: the paths of `count` pixels from number `first` on, and their hits if known."""
    for block in range(len(paths.counts)):
        paths.counts[block] = max(0, min(BLOCK, count - block * BLOCK))
    for i in range(count):
        pixel = first + i
        origin, direction = pixel_line(pixels, pixel)
        set_vector(paths.floats, ORIGIN, i, origin)
        set_vector(paths.floats, DIRECTION, i, unit(direction))
        set_vector(paths.floats, WEIGHT, i, WHITE)
        paths.pixel[i] = pixel
        if len(pixels.prim_id) > 0:
            paths.prim_id[i] = seen_by(pixels, pixel)


@njit(forceinline=True)
def load_rays(packet, width, floats, origin, direction, first):  # type: ignore[no-untyped-def]
    """Load rays from number `first` on into the lanes of a packet."""
    for axis in range(3):
        for lane in range(width):
            packet.floats[(RAY_ORG_X + axis) * width + lane] = floats[origin + axis, first + lane]
            packet.floats[(RAY_DIR_X + axis) * width + lane] = ray_component(floats[direction + axis, first + lane])
    for lane in range(width):
        packet.floats[RAY_TNEAR * width + lane] = START


@cache
def trace_kernel(width: int) -> Callable[..., int]:
    """Stage 2, in packets of `width`."""

    @float_kernel
    def trace_paths(paths, scene, packet):  # type: ignore[no-untyped-def]
        """Find what the rays of all paths hit; returns their number."""
        for block in range(len(paths.counts)):
            start = block * BLOCK
            end = start + paths.counts[block]
            for first in range(start, end, width):
                lanes = min(width, end - first)
                load_rays(packet, width, paths.floats, ORIGIN, DIRECTION, first)
                for lane in range(width):
                    packet.valid[lane] = -1 if lane < lanes else 0
                    packet.floats[RAY_TFAR * width + lane] = INFINITY
                    set_no_hit(packet, width, lane)
                intersect(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    paths.prim_id[first + lane] = hit_prim_id(packet, width, lane)
        return paths.counts.sum()

    return trace_paths


@njit(forceinline=True)
def _add(sums, pixel, weight, light):  # type: ignore[no-untyped-def]
    """Add weighted light to a pixel's sums; returns whether it was finite."""
    arrived = weight[0] * light[0], weight[1] * light[1], weight[2] * light[2]
    for channel in range(3):
        sums[channel, pixel] += arrived[channel]
    return arrived[0] < INFINITY and arrived[1] < INFINITY and arrived[2] < INFINITY


@float_kernel
def compact(paths, surfaces, sums, is_last):  # type: ignore[no-untyped-def]
    """Stages 3 and 5: add paths that end at the sky or an emitter to `sums`; move the others to the front, in order.

    sums: (3, pixels) float32. is_last: all other paths end here, dark. Returns whether all light was finite.
    """
    floats = paths.floats
    is_finite = True
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            prim_id = paths.prim_id[i]
            if prim_id == MISS:
                sky = sky_colour(surfaces, vector(floats, DIRECTION, i))
                is_finite &= _add(sums, paths.pixel[i], vector(floats, WEIGHT, i), sky)
            elif surfaces.is_emissive[prim_id]:
                light = emitted(surfaces, prim_id, vector(floats, ORIGIN, i), vector(floats, DIRECTION, i))
                is_finite &= _add(sums, paths.pixel[i], vector(floats, WEIGHT, i), light)
            elif not is_last:
                if kept != i:
                    for row in range(PATH_ROWS):
                        floats[row, kept] = floats[row, i]
                    paths.prim_id[kept] = prim_id
                    paths.pixel[kept] = paths.pixel[i]
                kept += 1
        paths.counts[block] = kept - start
    return is_finite


@float_kernel
def shade(paths, surfaces, sample_key, bounce):  # type: ignore[no-untyped-def]
    """Stage 4: scatter each path; drop those that are absorbed, move the others to the front, in order."""
    floats = paths.floats
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            pixel = paths.pixel[i]
            goes_on, origin, direction, weight = scatter(
                surfaces, paths.prim_id[i], vector(floats, ORIGIN, i), vector(floats, DIRECTION, i),
                key_of(pixel, sample_key), bounce,
            )  # fmt: skip
            if goes_on:
                for channel in range(3):
                    floats[WEIGHT + channel, kept] = floats[WEIGHT + channel, i] * weight[channel]
                set_vector(floats, ORIGIN, kept, origin)
                set_vector(floats, DIRECTION, kept, direction)
                paths.pixel[kept] = pixel
                kept += 1
        paths.counts[block] = kept - start


@njit(forceinline=True)
def _prim_id_of_ray(scene, packet, origin, direction):  # type: ignore[no-untyped-def]
    """What one ray hits, by a packet of 1."""
    for axis in range(3):
        packet.floats[RAY_ORG_X + axis] = origin[axis]
        packet.floats[RAY_DIR_X + axis] = ray_component(direction[axis])
    packet.floats[RAY_TNEAR] = START
    packet.floats[RAY_TFAR] = INFINITY
    set_no_hit(packet, 1, 0)
    intersect(1, packet.valid, scene, packet)
    return hit_prim_id(packet, 1, 0)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, sums, max_depth):  # type: ignore[no-untyped-def]
    """All stages for one path after the other, with a packet of 1; the alternative to waves. Arguments as for the
    stages.

    Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays = True, 0
    for pixel in range(first, first + count):
        key = key_of(pixel, pixels.sample_key)
        origin, direction = pixel_line(pixels, pixel)
        direction = unit(direction)
        weight = WHITE
        for bounce in range(max_depth):
            if bounce == 0 and len(pixels.prim_id) > 0:
                prim_id = seen_by(pixels, pixel)
            else:
                rays += 1
                prim_id = _prim_id_of_ray(scene, packet, origin, direction)
            if prim_id == MISS:
                is_finite &= _add(sums, pixel, weight, sky_colour(surfaces, direction))
                break
            if surfaces.is_emissive[prim_id]:
                is_finite &= _add(sums, pixel, weight, emitted(surfaces, prim_id, origin, direction))
                break
            if bounce == max_depth - 1:
                break
            goes_on, origin, direction, factor = scatter(surfaces, prim_id, origin, direction, key, bounce)
            if not goes_on:
                break
            weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
    return rays if is_finite else -1
