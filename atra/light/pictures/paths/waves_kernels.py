"""Kernels of path tracing, a wave of paths stage by stage."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel
from atra.embree.layout import RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import INFINITY, MISS, START, hit_distance, hit_prim_id, intersect, set_no_hit
from atra.light.emitters.emitters_kernels import aim
from atra.light.numbers_kernels import ZERO, scaled, set_vector, unit, vector
from atra.light.pictures.path_kernels import (
    BLOCK,
    FREE_KIND,
    FREE_LIGHT,
    add_light,
    arriving,
    load_ray,
    load_rays,
    passed,
    passes_of,
    path_key,
    pixel_line,
    seen_by,
    shadows,
    survival,
)
from atra.light.scattering.spots_kernels import WHITE, scatter, spot_of
from atra.light.surface_kernels import ENDS, SHINES

ORIGIN, DIRECTION, WEIGHT, DENSITY, NEAR = 0, 3, 6, 9, 10
PATH_ROWS = 11


class Paths(NamedTuple):
    """A wave of N paths, in blocks of BLOCK. The first `counts` paths of each block continue.

    floats: (PATH_ROWS, N) float32: origin, unit direction, weight (r, g, b), three rows each; then the density of the
    direction, as of `scatter`; then the distance where the ray starts, and once it is traced, that of its hit. prim_id:
    (N,) uint32, hits. pixel: (N,) int32. bounce: (N,) int32, surfaces met so far. is_passing: (N,) bool, whether the
    ray goes on as it was, behind a hole. counts: (blocks,) int64.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    pixel: NDArray[np.int32]
    bounce: NDArray[np.int32]
    is_passing: NDArray[np.bool_]
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
        paths.floats[NEAR, i] = START
        paths.pixel[i] = pixel
        paths.bounce[i] = 0
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
                    packet.floats[RAY_TNEAR * width + lane] = paths.floats[NEAR, first + lane]
                    packet.floats[RAY_TFAR * width + lane] = INFINITY
                    set_no_hit(packet, width, lane)
                intersect(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    paths.prim_id[first + lane] = hit_prim_id(packet, width, lane)
                    paths.floats[NEAR, first + lane] = hit_distance(packet, width, lane)
        return paths.counts.sum()

    return trace_paths


@float_kernel
def compact(paths, surfaces, emitters, sums, sample, step, max_depth):  # type: ignore[no-untyped-def]
    """Stages 3 and 6: add light that paths meet to `sums`; move those that go on to the front, in order.

    sums: (3, pixels) float32. sample: number of the picture's sample. step: how often waves were traced. Returns
    whether all light was finite.
    """
    floats = paths.floats
    is_finite = True
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            prim_id, bounce = paths.prim_id[i], paths.bounce[i]
            flags = surfaces.flags[prim_id] if prim_id != MISS else ENDS | SHINES
            beyond = ZERO
            if flags & passes_of(bounce):
                beyond, weight = passed(
                    surfaces, prim_id, vector(floats, ORIGIN, i), vector(floats, DIRECTION, i), floats[NEAR, i],
                    vector(floats, WEIGHT, i), bounce == 0, (path_key(paths.pixel[i]), sample, step),
                )  # fmt: skip
                set_vector(floats, WEIGHT, i, weight)
            if beyond > ZERO:
                floats[NEAR, i] = beyond
            elif flags & SHINES:
                light = arriving(
                    surfaces, emitters, prim_id,
                    vector(floats, ORIGIN, i), vector(floats, DIRECTION, i), floats[DENSITY, i],
                )  # fmt: skip
                is_finite &= add_light(sums, paths.pixel[i], vector(floats, WEIGHT, i), light)
            if not beyond > ZERO and (flags & ENDS or bounce == max_depth - 1):
                continue
            if kept != i:
                for row in range(PATH_ROWS):
                    floats[row, kept] = floats[row, i]
                paths.prim_id[kept] = prim_id
                paths.pixel[kept] = paths.pixel[i]
                paths.bounce[kept] = bounce
            paths.is_passing[kept] = beyond > ZERO
            kept += 1
        paths.counts[block] = kept - start
    return is_finite


@cache
def connect_kernel(width: int) -> Callable[..., int]:
    """Stage 4, in packets of `width`."""

    @float_kernel
    def connect_paths(paths, surfaces, emitters, scene, packet, lights, free, sample, sums):  # type: ignore[no-untyped-def]
        """Aim a ray from every path at an emitter, and add what arrives to `sums`. lights: (3, width) float32, free:
        (FREE_ROWS, width) float32, scratch. Returns the number of rays, -1 if light was not finite."""
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
                    if paths.is_passing[i]:
                        continue
                    prim_id, direction = paths.prim_id[i], vector(floats, DIRECTION, i)
                    spot, _ = spot_of(surfaces, prim_id, vector(floats, ORIGIN, i), direction)
                    length, origin, towards, light, free[FREE_KIND, lane] = aim(
                        surfaces, emitters, spot, prim_id, direction, path_key(paths.pixel[i]), sample, paths.bounce[i]
                    )
                    if length > ZERO:
                        load_ray(packet, width, lane, origin, towards, length)
                        packet.valid[lane] = -1
                        set_vector(lights, 0, lane, light)
                        aimed += 1
                if aimed == 0:
                    continue
                rays += aimed
                shadows(width, surfaces, scene, packet, free)
                for lane in range(lanes):
                    red, green, blue = vector(free, FREE_LIGHT, lane)
                    if red + green + blue > ZERO:
                        weight, light = vector(floats, WEIGHT, first + lane), vector(lights, 0, lane)
                        light = red * light[0], green * light[1], blue * light[2]
                        is_finite &= add_light(sums, paths.pixel[first + lane], weight, light)
        return rays if is_finite else -1

    return connect_paths


@float_kernel
def shade(paths, surfaces, sample, roulette):  # type: ignore[no-untyped-def]
    """Stage 5: scatter each path; drop those that are absorbed, move the others to the front, in order."""
    floats = paths.floats
    for block in range(len(paths.counts)):
        start = block * BLOCK
        kept = start
        for i in range(start, start + paths.counts[block]):
            pixel, bounce = paths.pixel[i], paths.bounce[i]
            if paths.is_passing[i]:
                for row in range(PATH_ROWS):
                    floats[row, kept] = floats[row, i]
            else:
                key, prim_id, direction = path_key(pixel), paths.prim_id[i], vector(floats, DIRECTION, i)
                spot, is_front = spot_of(surfaces, prim_id, vector(floats, ORIGIN, i), direction)
                goes_on, origin, direction, factor, density = scatter(
                    surfaces, spot, is_front, prim_id, direction, key, sample, bounce
                )
                if not goes_on:
                    continue
                weight = vector(floats, WEIGHT, i)
                weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
                if bounce >= roulette:
                    share = survival(weight, key, sample, bounce)
                    if share == ZERO:
                        continue
                    weight = scaled(share, weight)
                set_vector(floats, WEIGHT, kept, weight)
                set_vector(floats, ORIGIN, kept, origin)
                set_vector(floats, DIRECTION, kept, direction)
                floats[DENSITY, kept] = density
                floats[NEAR, kept] = START
                bounce += 1
            paths.bounce[kept] = bounce
            paths.pixel[kept] = pixel
            kept += 1
        paths.counts[block] = kept - start
