"""Surfaces as kernels read them: where a ray meets a triangle, its normal there, its colour, and what it shows whatever
light falls on it: its emission, and the share of light that its holes let through."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO, dot, scaled
from atra.light.scattering.texels_kernels import image_at

RECORD_WORDS = 8
"""float64 numbers of a triangle, a cache line: unit normal (3), plane's n . p, offset of rays that leave it, material;
two unused."""

CONSTANT, CHECKER, IMAGE = 0, 1, 2

MATERIAL_ROW = np.dtype(
    [
        ("kind", "i8"), ("texture", "i8"), ("scale", "f8"), ("colour", "f4", 3), ("second", "f4", 3),
        ("parameter", "f4"), ("is_schlick", "?"), ("is_thin", "?"), ("images", "i8", 5), ("emission", "f4", 3),
        ("metallic", "f4"), ("roughness", "f4"), ("normal_scale", "f4"), ("transmission", "f4"), ("opacity", "f4"),
        ("cutoff", "f8"), ("has_colours", "?"), ("colours_emit", "?"), ("is_double", "?"), ("specular", "f4"),
        ("specular_colour", "f4", 3), ("coat", "f4"), ("coat_roughness", "f4"), ("absorption", "f8", 3),
    ],
    align=True,
)  # fmt: skip
"""A material for kernels; fields of `MetallicRoughness` have its names. kind: see `scattering.spots_kernels`, also for
parameter. is_schlick: as `Dielectric.fresnel` says. texture: of the colour; second, scale: of a checker. images: rows
of `textures`, of `Material.images`, -1 = none. cutoff: of a mask; below 0, opacity is a share of light; above 1, all
is opaque. has_colours: of vertices; colours_emit: emission is times these, too. is_double: whether the eye sees its
backs."""

OF_COLOUR, OF_METAL, OF_NORMALS, OF_EMISSION, OF_TRANSMISSION = 0, 1, 2, 3, 4

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
    materials: (M,) MATERIAL_ROW. textures: (N,) IMAGE_ROW. texels: (T, 4) float32, of all images
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
    materials: NDArray[np.void]
    textures: NDArray[np.void]
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
def three(numbers):  # type: ignore[no-untyped-def]
    return numbers[0], numbers[1], numbers[2]


@njit(forceinline=True)
def colour_of(surfaces, material, prim_id, point):  # type: ignore[no-untyped-def]
    """(r, g, b) float32 of a material at a point, vertices' colours left out."""
    if surfaces.materials[material].texture == CONSTANT:
        return three(surfaces.materials[material].colour)
    s, t = first_uv(surfaces, prim_id, weights_at(surfaces, prim_id, point))
    return colour_at(surfaces, material, prim_id, point, s, t)


@njit
def colour_at(surfaces, material, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    """`colour_of` where uv is (s, t)."""
    return colour_at_inlined(surfaces, material, prim_id, point, s, t)


@njit(forceinline=True)
def colour_at_inlined(surfaces, material, prim_id, point, s, t):  # type: ignore[no-untyped-def]
    """`colour_at`, for a caller with many points: handing `surfaces` over takes longer than the look-up."""
    row = surfaces.materials[material]
    if row.texture == IMAGE:
        return three(_textured(surfaces, material, OF_COLOUR, prim_id, point, s, t))
    if row.texture == CHECKER:
        cell = np.int64(np.floor(np.float64(s) * row.scale)) + np.int64(np.floor(np.float64(t) * row.scale))
        if cell & 1 != 0:
            return three(row.second)
    return three(row.colour)


@njit(forceinline=True)
def packed_image(surfaces, material):  # type: ignore[no-untyped-def]
    """The row of `textures` of a material whose colours `texels_kernels.colours_at` finds: bytes, blended, by the
    vertices' first uv, and vertices without colours; -1 = one by one."""
    row = surfaces.materials[material]
    if row.texture == IMAGE and not row.has_colours:
        number = row.images[OF_COLOUR]
        image = surfaces.textures[number]
        if image.curve >= 0 and not image.is_nearest and not image.second_uv:
            return number
    return np.int64(-1)


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
    number = surfaces.materials[material].images[which]
    if number < 0:
        return ONE, ONE, ONE, ONE
    if surfaces.textures[number].second_uv:
        s, t = second_uv(surfaces, prim_id, weights_at(surfaces, prim_id, point))
    return image_at(surfaces, number, s, t)


@njit
def emitted(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) of a triangle that shines, seen by a ray; its back is black."""
    point, _, is_front = meet(surfaces, prim_id, origin, direction)
    return emission_at(surfaces, prim_id, point) if is_front else (ZERO, ZERO, ZERO)


@njit
def emission_at(surfaces, prim_id, point):  # type: ignore[no-untyped-def]
    """(r, g, b) that the front of a triangle emits at a point."""
    material = material_of(surfaces, prim_id)
    row = surfaces.materials[material]
    light, has_image = three(row.emission), row.images[OF_EMISSION] >= 0
    if not (has_image or row.colours_emit):
        return light
    weights = weights_at(surfaces, prim_id, point)
    if has_image:
        s, t = first_uv(surfaces, prim_id, weights)
        texel = textured(surfaces, material, OF_EMISSION, prim_id, point, s, t)
        light = light[0] * texel[0], light[1] * texel[1], light[2] * texel[2]
    if row.colours_emit:
        colour = vertex_colour(surfaces, prim_id, weights)
        light = light[0] * colour[0], light[1] * colour[1], light[2] * colour[2]
    return light


@njit
def opacity_at(surfaces, prim_id, point, is_front, is_seen):  # type: ignore[no-untyped-def]
    """The share of light that meets a triangle with HOLES at a point; the rest passes. is_seen: by the eye."""
    row = surfaces.materials[material_of(surfaces, prim_id)]
    if is_seen and not is_front and not row.is_double:
        return ZERO
    cutoff = row.cutoff
    if cutoff > 1.0:
        return ONE
    opacity = row.opacity
    has_image = row.images[OF_COLOUR] >= 0
    if has_image or row.has_colours:
        weights = weights_at(surfaces, prim_id, point)
        if has_image:
            s, t = first_uv(surfaces, prim_id, weights)
            opacity *= textured(surfaces, material_of(surfaces, prim_id), OF_COLOUR, prim_id, point, s, t)[3]
        if row.has_colours:
            opacity *= vertex_colour(surfaces, prim_id, weights)[3]
    if cutoff < 0.0:
        return opacity
    return ONE if opacity >= cutoff else ZERO
