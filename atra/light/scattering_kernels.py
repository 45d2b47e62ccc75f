"""Scattering: how a path continues from a surface, by the kind of its material."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import (
    HALF,
    ONE,
    TWO,
    ZERO,
    along,
    around,
    bits_of,
    dot,
    on_sphere,
    scaled,
    unit,
    unit_of,
)
from atra.light.surface_kernels import (
    KIND,
    PARAMETER,
    VARIANT,
    colour_of,
    leaving,
    material_of,
    meet,
    on_side,
    plain_colour,
    shading_normal,
)

LAMBERTIAN, METAL, DIELECTRIC, EMISSIVE, PHYSICAL = 0, 1, 2, 3, 4
"""Kinds of material. PARAMETER: a metal's fuzz, glass's index of refraction. VARIANT: uniform directions (Lambertian),
rays pass below the surface (metal), Schlick's approximation (glass)."""

DIMENSIONS = 4
"""Random numbers per bounce."""

BLACK = ZERO, ZERO, ZERO
WHITE = ONE, ONE, ONE
_MINUS_TWO = np.float32(-2.0)
_PER_PI = np.float32(1.0 / np.pi)


@njit(forceinline=True)
def emitted(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) of an emissive triangle seen by a ray; its back is black."""
    _, _, is_front = meet(surfaces, prim_id, origin, direction)
    return plain_colour(surfaces, material_of(surfaces, prim_id)) if is_front else BLACK


@njit(forceinline=True)
def scatter(surfaces, prim_id, origin, direction, key, bounce):  # type: ignore[no-untyped-def]
    """(goes_on, origin, direction, weight, density): the next ray of a path, the (r, g, b) weight of its light, and how
    often its direction is chosen, per solid angle; 0 where no other direction was possible, or nothing is aimed.

    direction: unit vector. key, bounce: select the random numbers. goes_on: False if the path is absorbed.
    """
    point, normal, is_front = meet(surfaces, prim_id, origin, direction)
    material = material_of(surfaces, prim_id)
    kind = surfaces.materials[material, KIND]
    parameter = np.float32(surfaces.materials[material, PARAMETER])
    is_variant = surfaces.materials[material, VARIANT] != 0.0
    shaded = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
    dimension = np.uint32(bounce * DIMENSIONS)
    side = ONE
    if kind == DIELECTRIC:
        chance = unit_of(bits_of(key, dimension))
        weight = WHITE
        onward, passes = _through_glass(direction, shaded, is_front, parameter, is_variant, chance)
        side = -ONE if passes else ONE
    else:
        weight = colour_of(surfaces, material, prim_id, point)
        sphere = on_sphere(unit_of(bits_of(key, dimension)), unit_of(bits_of(key, dimension + np.uint32(1))))
        if kind == METAL:
            mirrored = along(direction, _MINUS_TWO * dot(direction, shaded), shaded)
            onward = unit(along(mirrored, parameter, sphere))
            if not dot(onward, shaded) > ZERO:
                if not is_variant:
                    return False, origin, direction, BLACK, ZERO
                side = ONE if dot(onward, normal) > ZERO else -ONE
        elif not is_variant:
            onward = around(shaded, sphere)
        else:  # uniform over the hemisphere: density 1 / (2 pi) where the reflectance is cos / pi
            onward = sphere if dot(sphere, shaded) >= ZERO else scaled(-ONE, sphere)
            weight = scaled(TWO * dot(onward, shaded), weight)
    onward = on_side(onward, normal, side)
    density = _densities(shaded, normal, onward, is_variant)[1] if kind == LAMBERTIAN else ZERO
    return True, leaving(surfaces, prim_id, point, scaled(side, normal)), onward, weight, density


@njit
def _densities(shaded, normal, onward, is_uniform):  # type: ignore[no-untyped-def]
    """(by the cosine, own): densities of a direction on the side of `normal`, per solid angle, if directions are chosen
    by the cosine, and as they are. Both count the direction that `on_side` mirrors there."""
    cosine = max(ZERO, dot(onward, shaded))
    mirrored = max(ZERO, dot(along(onward, _MINUS_TWO * dot(onward, normal), normal), shaded))
    by_cosine = (cosine + mirrored) * _PER_PI
    if not is_uniform:
        return by_cosine, by_cosine
    count = (ONE if cosine > ZERO else ZERO) + (ONE if mirrored > ZERO else ZERO)
    return by_cosine, HALF * _PER_PI * count


@njit
def scattered_light(surfaces, prim_id, point, normal, is_front, direction, onward):  # type: ignore[no-untyped-def]
    """((r, g, b), density): what a surface scatters of light from the unit vector `onward`, on the side of `normal`,
    per solid angle, and the density with which `scatter` chooses it. 0 for mirrors and glass, whose light only
    scattering finds.

    point, normal, is_front: of `meet`.
    """
    material = material_of(surfaces, prim_id)
    if surfaces.materials[material, KIND] != LAMBERTIAN:
        return BLACK, ZERO
    shaded = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
    by_cosine, own = _densities(shaded, normal, onward, surfaces.materials[material, VARIANT] != 0.0)
    return scaled(by_cosine, colour_of(surfaces, material, prim_id, point)), own


@njit(error_model="numpy")
def _through_glass(direction, normal, is_front, ior, is_schlick, chance):  # type: ignore[no-untyped-def]
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
