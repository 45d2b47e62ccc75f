"""Surfaces and sky as kernels read them: where a ray meets a triangle, its normal there, and its colour."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO, dot, scaled

RECORD_WORDS = 8
"""float64 numbers of a triangle, a cache line: unit normal (3), plane's n . p, offset of rays that leave it, material;
two unused."""

CONSTANT, CHECKER, IMAGE = 0, 1, 2

KIND, COLOUR, TEXTURE, SECOND, SCALE, PARAMETER, VARIANT = 0, 1, 4, 5, 8, 9, 10
METALLIC, ROUGHNESS, EMISSION, NORMAL_SCALE, TRANSMISSION, OPACITY, CUTOFF, IMAGES, HAS_COLOURS, BACKS = (
    11, 12, 13, 16, 17, 18, 19, 20, 25, 26,
)  # fmt: skip
SPECULAR, TINT, COAT, COAT_ROUGHNESS, ABSORPTION = 27, 28, 31, 32, 33
MATERIAL_WORDS, COLOURS_EMIT = 36, 2
"""float64 numbers of a material. KIND: see `scattering.spots_kernels`, also for PARAMETER and VARIANT. COLOUR,
SECOND, EMISSION: three each. CUTOFF: of a mask; below 0, opacity is a share of light; above 1, all is opaque. IMAGES:
rows of `textures`, of `MetallicRoughness.images` (5), -1 = none. HAS_COLOURS: of vertices; if COLOURS_EMIT, emission is
times these, too. BACKS: whether the eye sees them. TINT: of SPECULAR (3). ABSORPTION: per unit of length within (3)."""

OF_COLOUR, OF_METAL, OF_NORMALS, OF_EMISSION, OF_TRANSMISSION = 0, 1, 2, 3, 4

FIRST_TEXEL, TEXELS_X, TEXELS_Y, WRAP_X, WRAP_Y, CURVE, NEAREST, UV, FACTOR, PLACEMENT = 0, 1, 2, 3, 4, 5, 6, 7, 8, 12
TEXTURE_WORDS = 18
"""float64 numbers of an image. CURVE: -1 for texels of float32; otherwise the row of `curves` for bytes. UV: 1 for the
second. FACTOR: of four channels. PLACEMENT: of the image's s and t by those of the vertices (6)."""

REPEAT, MIRROR, CLAMP = 0, 1, 2

SHINES, ENDS, HOLES, ONE_SIDED, SOLID = 1, 2, 4, 8, 16
"""Bits of `flags`. SHINES: the front emits. ENDS: nothing is reflected. HOLES: light may pass straight on. ONE_SIDED:
the eye looks through the back. SOLID: clear glass that bends light, but lets that of lamps straight on."""

GRADIENT, PANORAMA = 0, 1
SKY_WORDS, SKY_TURN = 8, 1
"""float32 numbers of the sky: kind, then the colours below and above, or how far a panorama is turned, in turns."""

CORNER_WORDS = 8
"""float64 numbers of a triangle in `weights`: a cache line."""

MORE_WORDS = 18

LEAST_SQUARED = np.float32(1e-12)
"""Shorter interpolated normals, by squared length, are ignored."""

TINY = np.float64(1e-300)
"""Replaces the cosine of a ray nearly parallel to a plane."""


class Surfaces(NamedTuple):
    """The triangles, materials and sky of a scene.

    records: (F, RECORD_WORDS) float64. flags: (F,) uint8. weights: (F, CORNER_WORDS) float64, or (0, ...) if colour and
    normal are constant on all triangles; two affine functions give the barycentric weights of the second and third
    corners at a point. corners: (F, 2 CORNER_WORDS) float32, or (0, ...): three shading normals (9; 0 if there are
    none), three uv (6), 1 unused. more: (F, MORE_WORDS) float32, or (0, ...): three colours (12), three second uv (6).
    materials: (M, MATERIAL_WORDS) float64. textures: (N, TEXTURE_WORDS) float64. texels: (T, 4) float32, of all images
    of floats; coded: (T, 4) uint8, of all images of bytes; curves: (2, 256) float32, what a byte stands for, linearly
    and in sRGB. sky: (SKY_WORDS,) float32. panorama: (H, W, 3) float32, row 0 above; +y is up, the middle column looks
    along -z; harmonics: (9, 3) float32, its light on surfaces, as for `reflected`. has_holes: whether rays to lights
    may pass a triangle. is_looked_through: whether the eye may.
    """

    records: NDArray[np.float64]
    flags: NDArray[np.uint8]
    weights: NDArray[np.float64]
    corners: NDArray[np.float32]
    more: NDArray[np.float32]
    materials: NDArray[np.float64]
    textures: NDArray[np.float64]
    texels: NDArray[np.float32]
    coded: NDArray[np.uint8]
    curves: NDArray[np.float32]
    sky: NDArray[np.float32]
    panorama: NDArray[np.float32]
    harmonics: NDArray[np.float32]
    has_holes: bool
    is_looked_through: bool


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
def weights_at(surfaces, prim_id, point):  # type: ignore[no-untyped-def]
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
    u, v, w = weights_at(surfaces, prim_id, point)
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
    """(r, g, b) float32 of a material at a point, vertices' colours left out."""
    if surfaces.materials[material, TEXTURE] == CONSTANT:
        return plain_colour(surfaces, material)
    s, t = first_uv(surfaces, prim_id, weights_at(surfaces, prim_id, point))
    return colour_at(surfaces, material, prim_id, point, s, t)


@njit
def colour_at(surfaces, material, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    """`colour_of` where uv is (s, t)."""
    return colour_at_inlined(surfaces, material, prim_id, point, s, t)


@njit(forceinline=True)
def colour_at_inlined(surfaces, material, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    """`colour_at`, for a caller with many points: handing `surfaces` over takes longer than the look-up."""
    rows = surfaces.materials
    if rows[material, TEXTURE] == IMAGE:
        texel = _textured(surfaces, material, OF_COLOUR, prim_id, point, s, t)
        return texel[0], texel[1], texel[2]
    if rows[material, TEXTURE] == CHECKER:
        scale = rows[material, SCALE]
        cell = np.int64(np.floor(np.float64(s) * scale)) + np.int64(np.floor(np.float64(t) * scale))
        if cell & 1 != 0:
            second = rows[material, SECOND], rows[material, SECOND + 1], rows[material, SECOND + 2]
            return np.float32(second[0]), np.float32(second[1]), np.float32(second[2])
    return plain_colour(surfaces, material)


@njit(forceinline=True)
def first_uv(surfaces, prim_id, weights):  # type: ignore[no-untyped-def]
    u, v, w = weights
    uv = surfaces.corners
    return (
        u * uv[prim_id, 9] + v * uv[prim_id, 11] + w * uv[prim_id, 13],
        u * uv[prim_id, 10] + v * uv[prim_id, 12] + w * uv[prim_id, 14],
    )


@njit
def second_uv(surfaces, prim_id, weights):  # type: ignore[no-untyped-def]
    u, v, w = weights
    more = surfaces.more
    return (
        u * more[prim_id, 12] + v * more[prim_id, 14] + w * more[prim_id, 16],
        u * more[prim_id, 13] + v * more[prim_id, 15] + w * more[prim_id, 17],
    )


@njit
def vertex_colour(surfaces, prim_id, weights):  # type: ignore[no-untyped-def]
    """(r, g, b, opacity) float32 between the corners' colours."""
    u, v, w = weights
    more = surfaces.more
    return (
        u * more[prim_id, 0] + v * more[prim_id, 4] + w * more[prim_id, 8],
        u * more[prim_id, 1] + v * more[prim_id, 5] + w * more[prim_id, 9],
        u * more[prim_id, 2] + v * more[prim_id, 6] + w * more[prim_id, 10],
        u * more[prim_id, 3] + v * more[prim_id, 7] + w * more[prim_id, 11],
    )


@njit
def textured(surfaces, material, which, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    """Four channels, float32, of one of a material's images at a point whose first uv is (s, t); 1 without it."""
    return _textured(surfaces, material, which, prim_id, point, s, t)


@njit(forceinline=True)
def _textured(surfaces, material, which, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    number = np.int64(surfaces.materials[material, IMAGES + which])
    if number < 0:
        return ONE, ONE, ONE, ONE
    row = surfaces.textures[number]
    if row[UV] != 0.0:
        s, t = second_uv(surfaces, prim_id, weights_at(surfaces, prim_id, point))
    x = row[PLACEMENT] * s + row[PLACEMENT + 1] * t + row[PLACEMENT + 2]
    y = row[PLACEMENT + 3] * s + row[PLACEMENT + 4] * t + row[PLACEMENT + 5]
    columns, rows = np.int64(row[TEXELS_X]), np.int64(row[TEXELS_Y])
    x, y = _wrapped(x, row[WRAP_X]) * columns - 0.5, _wrapped(1.0 - y, row[WRAP_Y]) * rows - 0.5
    if row[NEAREST] != 0.0:
        x, y = np.floor(x + 0.5), np.floor(y + 0.5)
    left, above = np.floor(x), np.floor(y)
    fx, fy = np.float32(x - left), np.float32(y - above)
    x0, x1 = _inside(np.int64(left), columns, row[WRAP_X]), _inside(np.int64(left) + 1, columns, row[WRAP_X])
    y0, y1 = _inside(np.int64(above), rows, row[WRAP_Y]), _inside(np.int64(above) + 1, rows, row[WRAP_Y])
    first, curve = np.int64(row[FIRST_TEXEL]), np.int64(row[CURVE])
    a, b = _texel(surfaces, curve, first + y0 * columns + x0), _texel(surfaces, curve, first + y0 * columns + x1)
    c, d = _texel(surfaces, curve, first + y1 * columns + x0), _texel(surfaces, curve, first + y1 * columns + x1)
    wa, wb, wc, wd = (ONE - fx) * (ONE - fy), fx * (ONE - fy), (ONE - fx) * fy, fx * fy
    return (
        np.float32(row[FACTOR]) * (wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0]),
        np.float32(row[FACTOR + 1]) * (wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1]),
        np.float32(row[FACTOR + 2]) * (wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2]),
        np.float32(row[FACTOR + 3]) * (wa * a[3] + wb * b[3] + wc * c[3] + wd * d[3]),
    )


@njit(forceinline=True)
def _texel(surfaces, curve, place):  # type: ignore[no-untyped-def]
    """(r, g, b, opacity) float32 of a texel, in linear light."""
    if curve < 0:
        texels = surfaces.texels
        return texels[place, 0], texels[place, 1], texels[place, 2], texels[place, 3]
    coded, curves = surfaces.coded, surfaces.curves
    return (
        curves[curve, coded[place, 0]],
        curves[curve, coded[place, 1]],
        curves[curve, coded[place, 2]],
        curves[0, coded[place, 3]],
    )


@njit(forceinline=True)
def _wrapped(place, wrap):  # type: ignore[no-untyped-def]
    """A place along an axis of an image -> one in [0, 1]."""
    if wrap == CLAMP:
        return min(1.0, max(0.0, place))
    if wrap == MIRROR:
        place = place - 2.0 * np.floor(0.5 * place)
        return place if place <= 1.0 else 2.0 - place
    return place - np.floor(place)


@njit(forceinline=True)
def _inside(place, count, wrap):  # type: ignore[no-untyped-def]
    """The number of a texel that is at most one beyond an end."""
    if wrap == REPEAT:
        return place + count if place < 0 else place - count if place >= count else place
    return min(count - 1, max(0, place))
