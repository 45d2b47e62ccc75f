"""What is bent: shading normals by images of normals; directions by glass, and to the side of a surface where light may
leave. And what glass absorbs."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, cross, dot, scaled, unit
from atra.light.scattering.lost_kernels import schlick
from atra.light.surface_kernels import three


@njit(forceinline=True)
def bump_of(texel, scale):  # type: ignore[no-untyped-def]
    """(x, y, z) that a texel of an image of normals stands for, x and y times `scale`."""
    return scale * (TWO * texel[0] - ONE), scale * (TWO * texel[1] - ONE), TWO * texel[2] - ONE


@njit(error_model="numpy")
def bumped(surfaces, prim_id, shaded, bump, is_front, direction):  # type: ignore[no-untyped-def]
    """The normal that an image of normals makes of `shaded`, or `shaded` itself where it faces away from the ray.

    The tangent leads along growing u, the bitangent along growing v, within the triangle.
    """
    rows, uv = surfaces.weights, surfaces.corners
    s1, s2 = np.float64(uv[prim_id, 11] - uv[prim_id, 9]), np.float64(uv[prim_id, 13] - uv[prim_id, 9])
    t1, t2 = np.float64(uv[prim_id, 12] - uv[prim_id, 10]), np.float64(uv[prim_id, 14] - uv[prim_id, 10])
    along_t = (
        np.float32(t1 * rows[prim_id, 0] + t2 * rows[prim_id, 4]),
        np.float32(t1 * rows[prim_id, 1] + t2 * rows[prim_id, 5]),
        np.float32(t1 * rows[prim_id, 2] + t2 * rows[prim_id, 6]),
    )
    turn = ONE if (s1 * t2 - s2 * t1 > 0.0) else -ONE
    front = scaled(ONE if is_front else -ONE, shaded)
    tangent = scaled(turn, cross(along_t, front))
    squared = dot(tangent, tangent)
    if not squared > ZERO:
        return shaded
    tangent = scaled(ONE / np.sqrt(squared), tangent)
    bitangent = scaled(turn, cross(front, tangent))
    normal = along(along(scaled(bump[2], front), bump[0], tangent), bump[1], bitangent)
    squared = dot(normal, normal)
    if not squared > ZERO:
        return shaded
    normal = scaled((ONE if is_front else -ONE) / np.sqrt(squared), normal)
    return normal if dot(normal, direction) < ZERO else shaded


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
        reflectance = least + (ONE - least) * schlick(cosine)
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
    red, green, blue = three(surfaces.materials[material].absorption)
    if red == 0.0 and green == 0.0 and blue == 0.0:
        return ONE, ONE, ONE
    return np.float32(np.exp(-red * length)), np.float32(np.exp(-green * length)), np.float32(np.exp(-blue * length))
