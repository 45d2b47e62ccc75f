"""Directions that are bent: by glass, and to the side of the surface on which light may leave; what glass absorbs."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, dot, scaled, unit
from atra.light.surface_kernels import ABSORPTION


@njit
def on_side(direction, normal, wanted):  # type: ignore[no-untyped-def]
    """A direction, mirrored at the triangle's plane if it is not on the `wanted` side (1 or -1) of its normal. Shading
    normals may scatter light through a surface; dropping it would darken rims."""
    across = dot(direction, normal)
    if across * wanted >= ZERO:
        return direction
    return unit(along(direction, np.float32(-2.0) * across, normal))


@njit(error_model="numpy")
def through_glass(direction, normal, is_front, ior, is_schlick, chance):  # type: ignore[no-untyped-def]
    """(direction, passes): refracted, or reflected with the probability of Fresnel's equations.

    Source: Fresnel's equations for unpolarised light; C. Schlick, "An inexpensive BRDF model", 1994.
    """
    ratio = ONE / ior if is_front else ior
    cosine = min(ONE, -dot(direction, normal))
    inside = ONE - ratio * ratio * (ONE - cosine * cosine)
    mirrored = unit(along(direction, TWO * cosine, normal))
    if inside <= ZERO:
        return mirrored, False
    refracted_cosine = np.sqrt(inside)
    if is_schlick:
        least = (ONE - ior) / (ONE + ior)
        least *= least
        rest = ONE - cosine
        square = rest * rest
        reflectance = least + (ONE - least) * square * square * rest
    else:
        across = (ratio * cosine - refracted_cosine) / (ratio * cosine + refracted_cosine)
        within = (cosine - ratio * refracted_cosine) / (cosine + ratio * refracted_cosine)
        reflectance = (across * across + within * within) / TWO
    if chance < reflectance:
        return mirrored, False
    return unit(along(scaled(ratio, direction), ratio * cosine - refracted_cosine, normal)), True


@njit(forceinline=True, error_model="numpy")
def passed_within(surfaces, material, length):  # type: ignore[no-untyped-def]
    """(r, g, b) that is left of light on a way of this length to the back of a surface, within what it encloses.

    Source: the law of Beer, Lambert and Bouguer.
    """
    row = surfaces.materials[material]
    if row[ABSORPTION] == 0.0 and row[ABSORPTION + 1] == 0.0 and row[ABSORPTION + 2] == 0.0:
        return ONE, ONE, ONE
    return (
        np.float32(np.exp(-row[ABSORPTION] * length)),
        np.float32(np.exp(-row[ABSORPTION + 1] * length)),
        np.float32(np.exp(-row[ABSORPTION + 2] * length)),
    )
