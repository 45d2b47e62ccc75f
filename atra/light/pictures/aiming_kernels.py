"""Kernels that aim a ray from each pixel's surface at a light or into the sky."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_part, njit
from atra.light.lights_kernels import KIND, SUN, to_lamp, to_sun
from atra.light.numbers_kernels import ONE, ZERO, around, bits_of, dot, key_of, on_sphere, scaled, unit_of
from atra.light.pictures.gbuffer_kernels import (
    DIRECTION,
    LENGTH,
    LIGHT,
    NORMAL,
    ORIGIN,
    SEEN,
    STRIDE,
    set_vector,
    vector_of,
)


class Aim(NamedTuple):
    """The sample points of rays in the unit square.

    points: (N, 2) uint32, in units of 2^-32. is_traced: whether rays are traced for occlusion. length: float32, longest
    ray.
    """

    points: NDArray[np.uint32]
    is_traced: bool
    length: np.float32


@njit(forceinline=True)
def _set_lit(floats, i, direction, carried, reach):  # type: ignore[no-untyped-def]
    """Write a pixel's ray; returns 1 if it carries light, else 0."""
    is_lit = carried > ZERO
    set_vector(floats, DIRECTION, i, direction)
    floats[LENGTH * STRIDE + i] = reach if is_lit else ZERO
    floats[LIGHT * STRIDE + i] = carried if is_lit else ZERO
    return 1 if is_lit else 0


@njit(forceinline=True)
def _set_open(floats, i, direction, length):  # type: ignore[no-untyped-def]
    is_seen = floats[SEEN * STRIDE + i] != ZERO
    set_vector(floats, DIRECTION, i, direction)
    floats[LENGTH * STRIDE + i] = length if is_seen else ZERO
    floats[LIGHT * STRIDE + i] = ONE
    return 1 if is_seen else 0


@float_part
def aim_at_light(floats, count, light, aim, number):  # type: ignore[no-untyped-def]
    """Aim a ray from each pixel's surface at a point of the light, the same for all. light: (LIGHT_WORDS,) float32.
    Returns how many may arrive."""
    rays, u, v = 0, unit_of(aim.points[number, 0]), unit_of(aim.points[number, 1])
    if light[KIND] == SUN:
        direction = to_sun(light, u, v)
        for i in range(count):
            rays += _set_lit(floats, i, direction, dot(vector_of(floats, NORMAL, i), direction), aim.length)
    else:
        for i in range(count):
            rays += _aim_at_lamp(floats, i, light, u, v, aim.length)
    return rays


@njit(error_model="numpy")
def _aim_at_lamp(floats, i, light, u, v, length):  # type: ignore[no-untyped-def]
    """`aim_at_light` for one pixel and a light that is no sun."""
    direction, strength, reach = to_lamp(light, vector_of(floats, ORIGIN, i), u, v)
    carried = dot(vector_of(floats, NORMAL, i), direction) * strength
    return _set_lit(floats, i, direction, carried, min(reach, length))


@float_part
def aim_into_sky(floats, first, count, is_cosine, aim, number):  # type: ignore[no-untyped-def]
    """Aim a ray from the surface of each pixel, from number `first` on, into its hemisphere, by a point that is shifted
    for each. Returns the number of rays."""
    rays = 0
    for i in range(count):
        key, normal = key_of(first + i, np.uint32(0)), vector_of(floats, NORMAL, i)
        u = np.uint32(aim.points[number, 0] + bits_of(key, 0))
        v = np.uint32(aim.points[number, 1] + bits_of(key, 1))
        direction = on_sphere(unit_of(u), unit_of(v))
        if is_cosine:
            direction = around(normal, direction)
        elif dot(direction, normal) < ZERO:
            direction = scaled(-ONE, direction)
        rays += _set_open(floats, i, direction, aim.length)
    return rays
