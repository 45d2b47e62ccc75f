"""Kernels of path tracing, one path after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.geometry.view import View
from atra.light.numbers_kernels import ONE, ZERO, along, circle, dot, unit
from atra.light.pictures.path_kernels import add_light, path_key, pixel_line, seen_by
from atra.light.pictures.paths.following_kernels import follow, more
from atra.light.scattering.sampler_kernels import APERTURE, pair_of
from atra.light.scattering.spots_kernels import WHITE

ALPHA = 3
"""Plane of the film that holds the share of a pixel which is not sky."""

THIRDS = np.float32(1.0 / 3.0), np.float32(1.0 / 3.0), np.float32(1.0 / 3.0)


class Aperture(NamedTuple):
    """Where rays start. axes: (2, 3) float32, its radius to the right and down, in the world; none of a pinhole.
    nearness: of what is in focus, 1 over its depth."""

    axes: NDArray[np.float32]
    nearness: np.float32


def aperture_of(camera: View, radius: float, focus_distance: float) -> Aperture:
    """The aperture of a camera. radius, focus_distance: scene units."""
    axes = (radius * camera.axes[:2]).astype(np.float32)
    return Aperture(axes if radius > 0.0 else axes[:0], np.float32(1.0 / focus_distance))


@njit(forceinline=True)
def through(aperture, key, sample, origin, direction):  # type: ignore[no-untyped-def]
    """(origin, direction) from a point of the aperture to the point that the ray given has in focus. direction: of
    depth 1, as is the one returned."""
    square, turns = pair_of(key, sample, APERTURE)
    axes, radius, (right, down) = aperture.axes, np.sqrt(square), circle(turns)
    shift = (
        radius * (right * axes[0, 0] + down * axes[1, 0]),
        radius * (right * axes[0, 1] + down * axes[1, 1]),
        radius * (right * axes[0, 2] + down * axes[1, 2]),
    )
    return along(origin, ONE, shift), along(direction, -aperture.nearness, shift)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, emitters, sums, free, limits, aperture):  # type: ignore[no-untyped-def]
    """Add a sample of `count` pixels from number `first` on, one path after the other.

    scene, packet: of width 1. sums: (3 or 4, pixels) float32 of a `Film`. free: (FREE_ROWS, 1) float32, scratch.
    limits: `Limits`. aperture: `Aperture`. Where `sums` have a plane ALPHA, the sky that the eye sees is left out, and
    the share of it that is hidden is added there. Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays, is_known = True, 0, len(pixels.prim_id) > 0
    for pixel in range(first, first + count):
        origin, direction = pixel_line(pixels, pixel)
        known = np.int64(seen_by(pixels, pixel)) if is_known else np.int64(-1)
        random = path_key(pixel), pixels.sample
        if len(aperture.axes) > 0:
            origin, direction = through(aperture, random[0], random[1], origin, direction)
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
