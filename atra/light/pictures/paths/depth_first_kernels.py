"""Kernels of path tracing, one path after the other."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import float_kernel
from atra.light.numbers_kernels import ONE, ZERO, dot, unit
from atra.light.pictures.path_kernels import add_light, path_key, pixel_line, seen_by
from atra.light.pictures.paths.following_kernels import follow, more
from atra.light.scattering.spots_kernels import WHITE

ALPHA = 3
"""Plane of the film that holds the share of a pixel which is not sky."""

THIRDS = np.float32(1.0 / 3.0), np.float32(1.0 / 3.0), np.float32(1.0 / 3.0)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, emitters, sums, free, limits):  # type: ignore[no-untyped-def]
    """Add a sample of `count` pixels from number `first` on, one path after the other.

    scene, packet: of width 1. sums: (3 or 4, pixels) float32 of a `Film`. free: (FREE_ROWS, 1) float32, scratch.
    limits: `Limits`. Where `sums` have a plane ALPHA, the sky that the eye sees is left out, and the share of it that
    is hidden is added there. Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays, is_known = True, 0, len(pixels.prim_id) > 0
    for pixel in range(first, first + count):
        origin, direction = pixel_line(pixels, pixel)
        known = np.int64(seen_by(pixels, pixel)) if is_known else np.int64(-1)
        random = path_key(pixel), pixels.sample
        found = follow(
            surfaces, emitters, scene, packet, free, known, origin, unit(direction), ZERO, random, 0, limits
        )  # fmt: skip
        rays += found.rays
        light = more(found.emitted, WHITE, found.later)
        if sums.shape[0] > ALPHA:
            sums[ALPHA, pixel] += ONE - dot(found.seen_through, THIRDS)
        else:
            light = more(light, WHITE, found.sky)
        is_finite &= add_light(sums, pixel, WHITE, light)
    return rays if is_finite else -1
