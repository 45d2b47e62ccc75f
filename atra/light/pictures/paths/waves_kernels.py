"""Kernels of path tracing, a wave of paths stage by stage."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel
from atra.embree.layout import RAY_TFAR
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    hit_prim_id,
    intersect,
    occluded,
    set_no_hit,
)
from atra.light.emitters.emitters_kernels import aim
from atra.light.numbers_kernels import ZERO, key_of, set_vector, unit, vector
from atra.light.pictures.path_kernels import BLOCK, add_light, arriving, load_ray, load_rays, pixel_line, seen_by
from atra.light.scattering_kernels import WHITE, scatter

ORIGIN, DIRECTION, WEIGHT, DENSITY = 0, 3, 6, 9
PATH_ROWS = 10


class Paths(NamedTuple):
    """A wave of N paths, in blocks of BLOCK. The first `counts` paths of each block continue.

    floats: (PATH_ROWS, N) float32: origin, unit direction, weight (r, g, b), three rows each; then the density of the
    direction, as of `scatter`. prim_id: (N,) uint32, hits. pixel: (N,) int32. counts: (blocks,) int64.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    pixel: NDArray[np.int32]
    counts: NDArray[np.int64]


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
        paths.floats[DENSITY, i] = ZERO
        paths.pixel[i] = pixel
        if len(pixels.prim_id) > 0:
            paths.prim_id[i] = seen_by(pixels, pixel)


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


@float_kernel
def compact(paths, surfaces, emitters, sums, is_last):  # type: ignore[no-untyped-def]
    """Stages 3 and 6: add paths that end at the sky or an emitter to `sums`; move the others to the front, in order.

    sums: (3, pixels) float32. is_last: all other paths end here, dark. Returns whether all light was finite.
    """
    floats = paths.floats
    is_finite = True
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            prim_id = paths.prim_id[i]
            if prim_id == MISS or surfaces.flags[prim_id] != 0:
                light = arriving(
                    surfaces, emitters, prim_id,
                    vector(floats, ORIGIN, i), vector(floats, DIRECTION, i), floats[DENSITY, i],
                )  # fmt: skip
                is_finite &= add_light(sums, paths.pixel[i], vector(floats, WEIGHT, i), light)
            elif not is_last:
                if kept != i:
                    for row in range(PATH_ROWS):
                        floats[row, kept] = floats[row, i]
                    paths.prim_id[kept] = prim_id
                    paths.pixel[kept] = paths.pixel[i]
                kept += 1
        paths.counts[block] = kept - start
    return is_finite


@cache
def connect_kernel(width: int) -> Callable[..., int]:
    """Stage 4, in packets of `width`."""

    @float_kernel
    def connect_paths(paths, surfaces, emitters, scene, packet, lights, sample_key, bounce, sums):  # type: ignore[no-untyped-def]
        """Aim a ray from every path at an emitter, and add what arrives to `sums`. lights: (3, width) float32, scratch.
        Returns the number of rays, -1 if light was not finite."""
        floats = paths.floats
        rays, is_finite = 0, True
        for block in range(len(paths.counts)):
            start = block * BLOCK
            end = start + paths.counts[block]
            for first in range(start, end, width):
                lanes = min(width, end - first)
                aimed = 0
                for lane in range(width):
                    packet.valid[lane] = 0
                for lane in range(lanes):
                    i = first + lane
                    length, origin, direction, light = aim(
                        surfaces, emitters, paths.prim_id[i], vector(floats, ORIGIN, i), vector(floats, DIRECTION, i),
                        key_of(paths.pixel[i], sample_key), bounce,
                    )  # fmt: skip
                    if length > ZERO:
                        load_ray(packet, width, lane, origin, direction, length)
                        packet.valid[lane] = -1
                        set_vector(lights, 0, lane, light)
                        aimed += 1
                if aimed == 0:
                    continue
                rays += aimed
                occluded(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    if packet.valid[lane] != 0 and packet.floats[RAY_TFAR * width + lane] >= ZERO:
                        weight = vector(floats, WEIGHT, first + lane)
                        is_finite &= add_light(sums, paths.pixel[first + lane], weight, vector(lights, 0, lane))
        return rays if is_finite else -1

    return connect_paths


@float_kernel
def shade(paths, surfaces, sample_key, bounce):  # type: ignore[no-untyped-def]
    """Stage 5: scatter each path; drop those that are absorbed, move the others to the front, in order."""
    floats = paths.floats
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            pixel = paths.pixel[i]
            goes_on, origin, direction, weight, density = scatter(
                surfaces, paths.prim_id[i], vector(floats, ORIGIN, i), vector(floats, DIRECTION, i),
                key_of(pixel, sample_key), bounce,
            )  # fmt: skip
            if goes_on:
                for channel in range(3):
                    floats[WEIGHT + channel, kept] = floats[WEIGHT + channel, i] * weight[channel]
                set_vector(floats, ORIGIN, kept, origin)
                set_vector(floats, DIRECTION, kept, direction)
                floats[DENSITY, kept] = density
                paths.pixel[kept] = pixel
                kept += 1
        paths.counts[block] = kept - start
