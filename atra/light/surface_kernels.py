"""Surfaces and sky as kernels read them: where a ray meets a triangle, its normal there, and its colour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light.numbers_kernels import HALF, ONE, ZERO, along, dot, scaled, unit

RECORD_WORDS = 8
"""float64 numbers of a triangle, a cache line: unit normal (3), plane's n . p, offset of rays that leave it, material;
then four float32: colour (3), and 1 where colour and normal are constant."""

CONSTANT, CHECKER, IMAGE = 0, 1, 2

KIND, COLOUR, TEXTURE, SECOND, SCALE, PARAMETER, VARIANT, FIRST_TEXEL, TEXELS_X, TEXELS_Y = (
    0,
    1,
    4,
    5,
    8,
    9,
    10,
    11,
    12,
    13,
)
MATERIAL_WORDS = 14
"""float64 numbers of a material. KIND: see `atra.light.scattering_kernels`, also for PARAMETER and VARIANT. COLOUR,
SECOND: three each."""

GRADIENT, PANORAMA = 0, 1
SKY_WORDS = 8
"""float32 numbers of the sky: kind, then the colours below and above."""

CORNER_WORDS = 8
"""float64 numbers of a triangle in `weights`: a cache line."""

LEAST_SQUARED = np.float32(1e-12)
"""Shorter interpolated normals, by squared length, are ignored."""

TINY = np.float64(1e-300)
"""Replaces the cosine of a ray nearly parallel to a plane."""


class Surfaces(NamedTuple):
    """The triangles, materials and sky of a scene.

    records: (F, RECORD_WORDS) float64. is_emissive: (F,) bool. weights: (F, CORNER_WORDS) float64, or (0, ...) if
    colour and normal are constant on all triangles; two affine functions give the barycentric weights of the second and
    third corners at a point. corners: (F, 2 CORNER_WORDS) float32, or (0, ...): three shading normals (9; 0 if there
    are none), three uv (6), 1 unused. materials: (M, MATERIAL_WORDS) float64. texels: (T, 3) float32, of all images.
    sky: (SKY_WORDS,) float32. panorama: (H, W, 3) float32, row 0 above; +y is up, the middle column looks along -z.
    """

    records: NDArray[np.float64]
    is_emissive: NDArray[np.bool_]
    weights: NDArray[np.float64]
    corners: NDArray[np.float32]
    materials: NDArray[np.float64]
    texels: NDArray[np.float32]
    sky: NDArray[np.float32]
    panorama: NDArray[np.float32]


@njit(forceinline=True)
def meet(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(point, normal, is_front) where a ray meets a triangle's plane. The point is float64; the normal is float32 and
    faces the ray."""
    records = surfaces.records
    nx, ny, nz = records[prim_id, 0], records[prim_id, 1], records[prim_id, 2]
    x, y, z = np.float64(origin[0]), np.float64(origin[1]), np.float64(origin[2])
    facing = nx * direction[0] + ny * direction[1] + nz * direction[2]
    ahead = records[prim_id, 3] - (nx * x + ny * y + nz * z)
    t = ahead / (facing if abs(facing) > TINY else TINY)
    is_front = facing < 0.0
    side = ONE if is_front else -ONE
    normal = scaled(side, (np.float32(nx), np.float32(ny), np.float32(nz)))
    return (x + t * direction[0], y + t * direction[1], z + t * direction[2]), normal, is_front


@njit(forceinline=True)
def leaving(surfaces, prim_id, point, normal):  # type: ignore[no-untyped-def]
    """float32 origin of a ray that leaves a point on the side of `normal`, far enough off not to meet the triangle
    again."""
    off = surfaces.records[prim_id, 4]
    return (
        np.float32(point[0] + off * normal[0]),
        np.float32(point[1] + off * normal[1]),
        np.float32(point[2] + off * normal[2]),
    )


@njit(forceinline=True)
def material_of(surfaces, prim_id):  # type: ignore[no-untyped-def]
    return np.int64(surfaces.records[prim_id, 5])


@njit(forceinline=True)
def _weights(surfaces, prim_id, point):  # type: ignore[no-untyped-def]
    """float32 barycentric weights of a point in the triangle's plane."""
    rows = surfaces.weights
    v = rows[prim_id, 0] * point[0] + rows[prim_id, 1] * point[1] + rows[prim_id, 2] * point[2] + rows[prim_id, 3]
    w = rows[prim_id, 4] * point[0] + rows[prim_id, 5] * point[1] + rows[prim_id, 6] * point[2] + rows[prim_id, 7]
    return np.float32(1.0 - v - w), np.float32(v), np.float32(w)


@njit(forceinline=True)
def shading_normal(surfaces, prim_id, point, normal, is_front, direction):  # type: ignore[no-untyped-def]
    """The interpolated normal on the side of `normal`, or `normal` itself where that faces away from the ray."""
    if len(surfaces.weights) == 0:
        return normal
    u, v, w = _weights(surfaces, prim_id, point)
    rows = surfaces.corners
    smooth = (
        u * rows[prim_id, 0] + v * rows[prim_id, 3] + w * rows[prim_id, 6],
        u * rows[prim_id, 1] + v * rows[prim_id, 4] + w * rows[prim_id, 7],
        u * rows[prim_id, 2] + v * rows[prim_id, 5] + w * rows[prim_id, 8],
    )
    squared = dot(smooth, smooth)
    if not squared > LEAST_SQUARED:
        return normal
    smooth = scaled((ONE if is_front else -ONE) / np.sqrt(squared), smooth)
    return smooth if dot(smooth, direction) < ZERO else normal


@njit(forceinline=True)
def plain_colour(surfaces, material):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of a material without texture, or a checker's first."""
    rows = surfaces.materials
    return (
        np.float32(rows[material, COLOUR]),
        np.float32(rows[material, COLOUR + 1]),
        np.float32(rows[material, COLOUR + 2]),
    )


@njit(forceinline=True)
def colour_of(surfaces, material, prim_id, point):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of a material at a point."""
    if surfaces.materials[material, TEXTURE] == CONSTANT:
        return plain_colour(surfaces, material)
    u, v, w = _weights(surfaces, prim_id, point)
    uv = surfaces.corners
    s = u * uv[prim_id, 9] + v * uv[prim_id, 11] + w * uv[prim_id, 13]
    t = u * uv[prim_id, 10] + v * uv[prim_id, 12] + w * uv[prim_id, 14]
    return colour_at(surfaces, material, np.float64(s), np.float64(t))


@njit(forceinline=True)
def colour_at(surfaces, material, s, t):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of a material at uv (s, t)."""
    rows = surfaces.materials
    first = plain_colour(surfaces, material)
    if rows[material, TEXTURE] == CONSTANT:
        return first
    if rows[material, TEXTURE] == CHECKER:
        scale = rows[material, SCALE]
        cell = np.int64(np.floor(s * scale)) + np.int64(np.floor(t * scale))
        if cell & 1 == 0:
            return first
        second = rows[material, SECOND], rows[material, SECOND + 1], rows[material, SECOND + 2]
        return np.float32(second[0]), np.float32(second[1]), np.float32(second[2])
    across, down = np.int64(rows[material, TEXELS_X]), np.int64(rows[material, TEXELS_Y])
    return _texel(surfaces.texels, np.int64(rows[material, FIRST_TEXEL]), across, down, s, 1.0 - t)


@njit(error_model="numpy")
def _texel(texels, first, columns, rows, s, t):  # type: ignore[no-untyped-def]
    """Bilinear look-up at (s, t), which repeats; row 0 is at t = 0."""
    x, y = (s - np.floor(s)) * columns - 0.5, (t - np.floor(t)) * rows - 0.5
    left, above = np.floor(x), np.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - above)
    x0, y0 = np.int64(left) % columns, np.int64(above) % rows
    x1, y1 = (x0 + 1) % columns, (y0 + 1) % rows
    a, b = first + y0 * columns + x0, first + y0 * columns + x1
    c, d = first + y1 * columns + x0, first + y1 * columns + x1
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    return (
        wa * texels[a, 0] + wb * texels[b, 0] + wc * texels[c, 0] + wd * texels[d, 0],
        wa * texels[a, 1] + wb * texels[b, 1] + wc * texels[c, 1] + wd * texels[d, 1],
        wa * texels[a, 2] + wb * texels[b, 2] + wc * texels[c, 2] + wd * texels[d, 2],
    )


@njit(forceinline=True)
def sky_colour(surfaces, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of the sky in a direction, a unit vector."""
    sky = surfaces.sky
    if sky[0] == GRADIENT:
        above = HALF * (direction[1] + ONE)
        below = ONE - above
        return (below * sky[1] + above * sky[4], below * sky[2] + above * sky[5], below * sky[3] + above * sky[6])
    y, x = texel_of(surfaces.panorama.shape[0], surfaces.panorama.shape[1], direction)
    return surfaces.panorama[y, x, 0], surfaces.panorama[y, x, 1], surfaces.panorama[y, x, 2]


@njit(forceinline=True)
def texel_of(rows, columns, direction):  # type: ignore[no-untyped-def]
    """(y, x) of the texel of a panorama that a unit vector points to."""
    height = max(-1.0, min(1.0, np.float64(direction[1])))
    t = np.arccos(height) / np.pi
    s = 0.5 + np.arctan2(np.float64(direction[0]), -np.float64(direction[2])) / (2.0 * np.pi)
    return min(np.int64(t * rows), rows - 1), min(np.int64(s * columns), columns - 1)


@njit
def on_side(direction, normal, wanted):  # type: ignore[no-untyped-def]
    """A direction, mirrored at the triangle's plane if it is not on the `wanted` side (1 or -1) of its normal. Shading
    normals may scatter light through a surface; dropping it would darken rims."""
    across = dot(direction, normal)
    if across * wanted >= ZERO:
        return direction
    return unit(along(direction, np.float32(-2.0) * across, normal))
