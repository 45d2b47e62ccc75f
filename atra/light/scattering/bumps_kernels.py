"""Shading normals that images of normals make."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, TWO, ZERO, along, cross, dot, scaled


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
