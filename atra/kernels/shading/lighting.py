"""Lighting of what pixels see: rays to the lights and into the sky, and the sums they are added to."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from atra.embree.layout import FLAG_COHERENT, RAY_TFAR
from atra.kernels.caching import float_kernel
from atra.kernels.packets import INFINITY, hit_distance, occluded
from atra.kernels.shading.gbuffer import DIRECTION, NORMAL, ORIGIN
from atra.kernels.shading.numbers import (
    ONE,
    TWO,
    ZERO,
    along,
    around,
    bits_of,
    circle,
    dot,
    key_of,
    on_sphere,
    scaled,
    unit,
    unit_of,
)
from atra.kernels.shading.paths import load_rays

SUN, POINT, SPHERE = 0, 1, 2
KIND, PLACE, SIZE, ACROSS, UP = 0, 1, 4, 5, 8
LIGHT_WORDS = 11
"""float32 of a light. PLACE: where it is, or of a sun the unit vector to it (3). SIZE: its radius, or of a sun the
tangent of half the angle it appears under. ACROSS, UP: of a sun, unit vectors at right angles to it and to each other
(3 each)."""

SKY_PLANES = LIGHT_PLANES = 4
"""Sums of the sky, then of each light: r, g, b, and the share that is not in shadow."""

_ALMOST = np.float32(1 - 1e-4)
"""Of the way to a light: what is at the light itself does not shadow it."""


class Sample(NamedTuple):
    """Which points of the unit square rays are aimed at.

    u, v: the same for all pixels, in units of 2^-32. dimension: of the hash that shifts them, pixel by pixel.
    is_shifted: whether it does.
    """

    u: int
    v: int
    dimension: int
    is_shifted: bool


@njit(inline="always")
def _point(sample, pixel):  # type: ignore[no-untyped-def]
    """The two numbers in [0, 1) for a pixel."""
    u, v = np.uint32(sample.u), np.uint32(sample.v)
    if sample.is_shifted:
        key = key_of(pixel, np.uint32(0))
        u = np.uint32(u + bits_of(key, sample.dimension))
        v = np.uint32(v + bits_of(key, sample.dimension + 1))
    return unit_of(u), unit_of(v)


@njit(inline="always")
def _row(floats, first, i):  # type: ignore[no-untyped-def]
    return floats[first, i], floats[first + 1, i], floats[first + 2, i]


@njit(inline="always")
def _set_row(floats, first, i, vector):  # type: ignore[no-untyped-def]
    floats[first, i], floats[first + 1, i], floats[first + 2, i] = vector


@float_kernel
def aim_at_light(wave, first, count, light, length, sample):  # type: ignore[no-untyped-def]
    """A ray from each pixel's surface to a point of the light, at most `length` long. light: (LIGHT_WORDS,) float32."""
    floats = wave.floats
    kind, size = light[KIND], light[SIZE]
    centre = light[PLACE], light[PLACE + 1], light[PLACE + 2]
    across = light[ACROSS], light[ACROSS + 1], light[ACROSS + 2]
    up = light[UP], light[UP + 1], light[UP + 2]
    for i in range(count):
        normal = _row(floats, NORMAL, i)
        u, v = _point(sample, first + i)
        if kind == SUN:
            x, y = circle(v)
            radius = size * np.sqrt(u)
            direction = unit(along(along(centre, radius * x, across), radius * y, up))
            strength, reach = ONE, INFINITY
        else:
            to_light = along(centre, -ONE, _row(floats, ORIGIN, i))
            squared = dot(to_light, to_light)
            distance = np.sqrt(squared)
            direction = scaled(ONE / distance, to_light)
            strength, reach = ONE / squared, distance * _ALMOST
            if kind == SPHERE and distance > size:
                # Uniform over the solid angle it is seen under, 2 pi (1 - cos), of which pi (size / distance)^2 is the
                # projected part: their quotient, 1 for a far light, weighs its directions.
                ratio = size * size / squared
                depth = ratio / (ONE + np.sqrt(ONE - ratio))  # 1 - cos, without losing digits
                strength *= TWO * depth / ratio
                cosine = ONE - u * depth
                radius = np.sqrt(max(ZERO, ONE - cosine * cosine))
                x, y = circle(v)
                side = _across(direction)
                other = (
                    direction[1] * side[2] - direction[2] * side[1],
                    direction[2] * side[0] - direction[0] * side[2],
                    direction[0] * side[1] - direction[1] * side[0],
                )
                direction = along(along(scaled(cosine, direction), radius * x, side), radius * y, other)
                reach = (distance - size) * _ALMOST
        carried = dot(normal, direction) * strength
        is_lit = wave.is_hit[i] != 0 and carried > ZERO
        _set_row(floats, DIRECTION, i, direction)
        wave.length[i] = min(reach, length) if is_lit else ZERO
        wave.light[i] = carried if is_lit else ZERO


@njit(error_model="numpy")
def _across(direction):  # type: ignore[no-untyped-def]
    """A unit vector at right angles to a unit vector."""
    if abs(direction[0]) > abs(direction[1]):
        return unit((-direction[2], ZERO, direction[0]))
    return unit((ZERO, direction[2], -direction[1]))


@float_kernel
def aim_into_sky(wave, first, count, length, is_cosine, sample):  # type: ignore[no-untyped-def]
    """A ray of `length` from each pixel's surface into its hemisphere, uniform or by the cosine."""
    floats = wave.floats
    for i in range(count):
        normal = _row(floats, NORMAL, i)
        u, v = _point(sample, first + i)
        direction = on_sphere(u, v)
        if is_cosine:
            direction = around(normal, direction)
        else:
            side = ONE if dot(direction, normal) >= ZERO else -ONE
            direction = scaled(side, direction)
        _set_row(floats, DIRECTION, i, direction)
        wave.length[i] = length if wave.is_hit[i] != 0 else ZERO
        wave.light[i] = ONE


@cache
def occlude_kernel(width: int) -> Callable[..., int]:
    """The rays of a wave, in packets of `width`, a constant of the compiled code."""

    @float_kernel
    def occlude(wave, count, scene, packet, flags, is_coherent):  # type: ignore[no-untyped-def]
        """`light` becomes 0 where something is in the way; returns how many rays were traced. Pixels keep their lanes,
        so that each has the same neighbours in every wave.

        flags: of the query. is_coherent: whether rays of neighbours head alike.
        """
        flags[0] = FLAG_COHERENT if is_coherent else 0
        rays = 0
        for first in range(0, count, width):
            load_rays(packet, width, wave.floats, ORIGIN, DIRECTION, first)
            before = rays
            for lane in range(width):
                length = wave.length[first + lane] if first + lane < count else ZERO
                packet.floats[RAY_TFAR * width + lane] = length
                packet.valid[lane] = -1 if length > ZERO else 0
                rays += 1 if length > ZERO else 0
            if rays > before:
                occluded(width, packet.valid, scene, packet)
                for lane in range(width):
                    light = wave.light[first + lane]
                    wave.light[first + lane] = ZERO if hit_distance(packet, width, lane) < ZERO else light
        return rays

    return occlude


@float_kernel
def add_light(wave, first, count, row, share, sums):  # type: ignore[no-untyped-def]
    """Add `share` of the light that arrived, times the colour in `row` and the two below, to (4, pixels) float32.

    Returns whether all of it was finite.
    """
    end = first + count
    light, red, green, blue = wave.light, wave.floats[row], wave.floats[row + 1], wave.floats[row + 2]
    r, g, b, free = sums[0, first:end], sums[1, first:end], sums[2, first:end], sums[3, first:end]
    is_finite = True
    for i in range(count):
        part = light[i] * share
        is_lit = part > ZERO
        arrived = red[i] * part, green[i] * part, blue[i] * part
        is_finite &= not is_lit or (arrived[0] < INFINITY and arrived[1] < INFINITY and arrived[2] < INFINITY)
        r[i] += arrived[0] if is_lit else ZERO
        g[i] += arrived[1] if is_lit else ZERO
        b[i] += arrived[2] if is_lit else ZERO
        free[i] += share if is_lit else ZERO
    return is_finite
