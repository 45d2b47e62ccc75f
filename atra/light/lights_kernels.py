"""Lights as kernels read them, and directions towards them."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, circle, cross, dot, scaled, unit

SUN, POINT, SPHERE, SPOT, PANEL = 0, 1, 2, 3, 4
KIND, PLACE, SIZE, ACROSS, UP = 0, 1, 4, 5, 8
LIGHT_WORDS = 11
"""float32 numbers of a light. PLACE: its position, or the unit vector to a sun (3). SIZE: its radius, or the tangent of
half a sun's apparent angle. ACROSS, UP: for a sun, unit vectors orthogonal to its direction and each other (3 each);
for a spot its axis (3), and the cosines of its inner and outer angles (2); for a panel the vectors from its centre to
the middles of two sides, whose cross product points to where it shines (3 each)."""

NEAREST = np.float32(1e-3)
"""Least squared distance to a point of a panel, as a share of a quarter of its area; keeps its light finite."""

ALMOST = np.float32(1 - 1e-4)
"""Shadow rays end at this fraction of the way, so that what stands at the light does not shadow it."""


@njit(forceinline=True)
def to_sun(light, u, v):  # type: ignore[no-untyped-def]
    """The direction to a point of a sun's disc, chosen by u, v in [0, 1)."""
    x, y = circle(v)
    radius = light[SIZE] * np.sqrt(u)
    centre = light[PLACE], light[PLACE + 1], light[PLACE + 2]
    across = light[ACROSS], light[ACROSS + 1], light[ACROSS + 2]
    up = light[UP], light[UP + 1], light[UP + 2]
    return unit(along(along(centre, radius * x, across), radius * y, up))


@njit(forceinline=True, error_model="numpy")
def to_lamp(light, origin, u, v):  # type: ignore[no-untyped-def]
    """(direction, strength, reach) of a ray to a point or spot light, or to a point of a panel or a visible one of a
    sphere, chosen by u, v in [0, 1)."""
    centre = light[PLACE], light[PLACE + 1], light[PLACE + 2]
    if light[KIND] == PANEL:
        across, up = _sides(light)
        centre = along(along(centre, TWO * u - ONE, across), TWO * v - ONE, up)
    to_light = along(centre, -ONE, origin)
    squared = dot(to_light, to_light)
    distance = np.sqrt(squared)
    direction = scaled(ONE / distance, to_light)
    strength, reach = ONE / squared, distance * ALMOST
    radius = light[SIZE]
    if light[KIND] == SPHERE and distance > radius:
        # Uniform over the visible solid angle, 2 pi (1 - cos). Its projected part is pi (radius / distance)^2; the
        # quotient of the two, 1 for a far light, weights the directions.
        ratio = radius * radius / squared
        depth = ratio / (ONE + np.sqrt(ONE - ratio))  # 1 - cos, without cancellation
        strength *= TWO * depth / ratio
        cosine = ONE - u * depth
        sine = np.sqrt(max(ZERO, ONE - cosine * cosine))
        x, y = circle(v)
        side = _across(direction)
        other = cross(direction, side)
        direction = along(along(scaled(cosine, direction), sine * x, side), sine * y, other)
        reach = (distance - radius) * ALMOST
    elif light[KIND] == SPOT:
        cosine = -dot(direction, (light[ACROSS], light[ACROSS + 1], light[ACROSS + 2]))
        strength *= _in_cone(cosine, light[UP], light[UP + 1])
    elif light[KIND] == PANEL:
        across, up = _sides(light)
        front = cross(across, up)
        quarter = np.sqrt(dot(front, front))
        facing = max(ZERO, -dot(direction, scaled(ONE / quarter, front)))
        strength = facing / max(squared, NEAREST * quarter)
    return direction, strength, reach


@njit(forceinline=True)
def _sides(light):  # type: ignore[no-untyped-def]
    """The two vectors of a panel."""
    return (light[ACROSS], light[ACROSS + 1], light[ACROSS + 2]), (light[UP], light[UP + 1], light[UP + 2])


@njit(error_model="numpy")
def _in_cone(cosine, inner, outer):  # type: ignore[no-untyped-def]
    """The share of a spot's light in a direction, by the cosines of its angle and of the cone's two."""
    if cosine <= outer:
        return ZERO
    share = min(ONE, (cosine - outer) / (inner - outer)) if inner > outer else ONE
    return share * share * (np.float32(3.0) - TWO * share)


@njit(error_model="numpy")
def _across(direction):  # type: ignore[no-untyped-def]
    """A unit vector orthogonal to a unit vector."""
    if abs(direction[0]) > abs(direction[1]):
        return unit((-direction[2], ZERO, direction[0]))
    return unit((ZERO, direction[2], -direction[1]))
