"""Lighting of what pixels see: rays to the lights and into the sky, and the sums they are added to."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.embree.layout import RAY_TFAR
from atra.kernels.caching import float_kernel
from atra.kernels.packets import INFINITY, MISS, hit_distance, occluded
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
from atra.kernels.shading.paths import load_rays, pixel_ray
from atra.kernels.shading.surface import colour_of, leaving, material_of, meet, shading_normal, sky_colour

ORIGIN, NORMAL, COLOUR, DIRECTION = 0, 3, 6, 9
WAVE_ROWS = 12

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


class Wave(NamedTuple):
    """What N pixels see, and one ray from each.

    floats: (WAVE_ROWS, N) float32: origin of rays, shading normal, colour, direction of the ray, three rows each. Where
    nothing is seen, the normal is the direction of the pixel's ray, and the colour white.
    is_hit: (N,) int32, -1 or 0. length: (N,) float32, how far the ray reaches, 0 = there is none.
    light: (N,) float32, what it carries if nothing is in its way; 0 once something is.
    """

    floats: NDArray[np.float32]
    is_hit: NDArray[np.int32]
    length: NDArray[np.float32]
    light: NDArray[np.float32]


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
def find_surfaces(wave, first, count, pixels, surfaces):  # type: ignore[no-untyped-def]
    """What `count` pixels from number `first` on see, from the `prim_id` of `pixels`."""
    for i in range(count):
        pixel = first + i
        prim_id = pixels.prim_id[pixel // pixels.width * pixels.stride + pixel % pixels.width]
        origin, direction = pixel_ray(pixels, pixel)
        if prim_id == MISS:
            wave.is_hit[i] = 0
            _set_row(wave.floats, NORMAL, i, direction)
            for channel in range(3):
                wave.floats[COLOUR + channel, i] = ONE
        else:
            point, normal, is_front = meet(surfaces, prim_id, origin, direction)
            wave.is_hit[i] = -1
            _set_row(wave.floats, ORIGIN, i, leaving(surfaces, prim_id, point, normal))
            shaded = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
            _set_row(wave.floats, NORMAL, i, shaded)
            _set_row(wave.floats, COLOUR, i, colour_of(surfaces, material_of(surfaces, prim_id), prim_id, point))


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
def occlude_kernel(width: int) -> Callable[..., None]:
    """The rays of a wave, in packets of `width`, a constant of the compiled code."""

    @float_kernel
    def occlude(wave, count, scene, packet):  # type: ignore[no-untyped-def]
        """`light` becomes 0 where something is in the way. Pixels keep their lanes, so that each has the same
        neighbours in every wave."""
        for first in range(0, count, width):
            lanes = min(width, count - first)
            load_rays(packet, width, wave.floats, ORIGIN, DIRECTION, first, lanes)
            anyone = False
            for lane in range(lanes):
                length = wave.length[first + lane]
                packet.floats[RAY_TFAR * width + lane] = length
                packet.valid[lane] = -1 if length > ZERO else 0
                anyone |= length > ZERO
            if anyone:
                occluded(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    if hit_distance(packet, width, lane) < ZERO:
                        wave.light[first + lane] = ZERO

    return occlude


@float_kernel
def add_light(wave, first, count, share, sums):  # type: ignore[no-untyped-def]
    """Add `share` of the light that arrived, times the colour, to a light's four planes, (4, pixels) float64.

    Returns whether all of it was finite.
    """
    is_finite = True
    for i in range(count):
        light = wave.light[i] * share
        is_finite &= light < INFINITY
        for channel in range(3):
            sums[channel, first + i] += wave.floats[COLOUR + channel, i] * light
        sums[3, first + i] += share if light > ZERO else ZERO
    return is_finite


@float_kernel
def add_sky(wave, first, count, share, surfaces, sums):  # type: ignore[no-untyped-def]
    """As `add_light`, for the light of the sky where the normal points."""
    is_finite = True
    for i in range(count):
        light = wave.light[i] * share
        if light > ZERO:
            sky = sky_colour(surfaces, _row(wave.floats, NORMAL, i))
            for channel in range(3):
                arrived = wave.floats[COLOUR + channel, i] * sky[channel] * light
                is_finite &= arrived < INFINITY
                sums[channel, first + i] += arrived
            sums[3, first + i] += light
    return is_finite
