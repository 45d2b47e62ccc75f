"""The G-buffer: what pixels see, with origins of further rays, normals and colours, before any light; and a ray from
each surface, at a light or into the sky.

Points, normals and colours come from the functions that paths use, one pixel after the other. Only images are looked up
eight pixels at once: with that one by one, too, a textured frame of 1280 x 720 pixels and 262,267 triangles took 1.22
to 1.3 times as long.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.memory import load, prefetch, store
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import bits_of, splat, where
from atra.embree.packets_kernels import MISS
from atra.light.emitters.sky_kernels import reflected, sky_colour
from atra.light.lights_kernels import KIND, SUN, to_lamp, to_sun
from atra.light.numbers_kernels import ONE, ZERO, around, dot, key_of, on_sphere, scaled, unit, unit_of
from atra.light.numbers_kernels import bits_of as random_bits
from atra.light.pictures.path_kernels import FREE_ROWS, TILE, pixel_line, place_of, seen_by
from atra.light.scattering.spots_kernels import BLACK
from atra.light.scattering.texels_kernels import colours_at, places_in
from atra.light.surface_kernels import (
    CONSTANT,
    GRADIENT,
    colour_at_inlined,
    first_uv,
    leaving,
    material_of,
    meet,
    packed_image,
    shading_normal,
    three,
    vertex_colour,
    weights_at,
)

CHUNK = 256
"""Pixels that pass all stages together; their data fits the nearest cache."""

LANES = 16
"""Pixels summed together; a chunk has room for as many more."""

STRIDE = CHUNK + LANES
ORIGIN, NORMAL, COLOUR, SKY, DIRECTION = 0, 3, 6, 9, 12
LENGTH, LIGHT, SEEN, UV = 15, 16, 17, 18
_ROWS = 20

_EIGHT = 8


class Chunk(NamedTuple):
    """The G-buffer of at most `CHUNK` pixels, and one ray from each.

    floats: (_ROWS x STRIDE,) float32, row by row. Three rows each: ORIGIN of rays; shading NORMAL, 0 for a miss;
    COLOUR; SKY, the colour times the sky's light there, or the sky that the pixel sees; DIRECTION of the ray. LENGTH of
    the ray, 0 = none. LIGHT: what the ray carries, 0 once it is blocked. SEEN: 1, or 0 for a miss. UV: two rows.
    prim_id: (STRIDE,) uint32, 0 for a miss. free: (FREE_ROWS, LANES) float32, as for `shadows`.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    free: NDArray[np.float32]


def new_chunk() -> Chunk:
    """An empty chunk."""
    return Chunk(
        np.zeros(_ROWS * STRIDE, np.float32), np.zeros(STRIDE, np.uint32), np.zeros((FREE_ROWS, LANES), np.float32)
    )


@njit(forceinline=True)
def fetch_ahead(first, end, pixels):  # type: ignore[no-untyped-def]
    """Prefetch the prim_ids of a chunk from pixel `first` on; they were written past the caches."""
    for pixel in range(first, min(first + CHUNK, end), TILE):
        x, y = place_of(pixels, pixel)
        prefetch(np.int64(pixels.prim_id.ctypes.data) + 4 * (y * pixels.stride + x))


@float_part
def find_triangles(chunk, first, count, pixels):  # type: ignore[no-untyped-def]
    """Fill the chunk with the triangles that `count` pixels from number `first` on see, by the prim_ids of `pixels`."""
    for i in range(count):
        prim_id = seen_by(pixels, first + i)
        is_seen = prim_id != MISS
        chunk.prim_id[i] = prim_id if is_seen else np.uint32(0)
        chunk.floats[SEEN * STRIDE + i] = ONE if is_seen else ZERO


@float_part
def find_surfaces(chunk, first, count, pixels, surfaces):  # type: ignore[no-untyped-def]
    """Fill the chunk with what `count` pixels from number `first` on see of its triangles."""
    floats = chunk.floats
    _fetch_rows(chunk, count, surfaces.records)
    _fetch_rows(chunk, count, surfaces.weights)
    _fetch_rows(chunk, count, surfaces.corners)
    for i in range(count):
        origin, direction = pixel_line(pixels, first + i)
        _find_place(floats, i, np.int64(chunk.prim_id[i]), origin, direction, surfaces)
    if len(surfaces.textures) > 0:
        for i in range(count, count + _EIGHT):  # nothing is behind the last pixel
            floats[LIGHT * STRIDE + i] = ZERO
        for i in range(0, count, _EIGHT):
            _find_images(chunk, i, surfaces)
    for i in range(count):
        if floats[LIGHT * STRIDE + i] != ZERO:
            _find_colour(floats, i, np.int64(chunk.prim_id[i]), surfaces)
        _find_sky(floats, i, surfaces)
    for i in range(count):
        if floats[SEEN * STRIDE + i] == ZERO:
            _, direction = pixel_line(pixels, first + i)
            set_vector(floats, NORMAL, i, BLACK)
            set_vector(floats, SKY, i, sky_colour(surfaces, unit(direction)))


@njit(forceinline=True)
def _fetch_rows(chunk, count, rows):  # type: ignore[no-untyped-def]
    """Prefetch a cache line of each triangle, if there are any."""
    if len(rows) > 0:
        for i in range(count):
            prefetch(np.int64(rows.ctypes.data) + rows.strides[0] * np.int64(chunk.prim_id[i]))


@njit(forceinline=True)
def _find_place(floats, i, prim_id, origin, direction, surfaces):  # type: ignore[no-untyped-def]
    """Where a ray meets the i-th pixel's triangle, its normal and uv there, and its colour if that is constant; LIGHT
    is 1 where it is not."""
    point, normal, is_front = meet(surfaces, prim_id, origin, direction)
    start, shaded, u, v = leaving(surfaces, prim_id, point, normal), normal, ZERO, ZERO
    if len(surfaces.weights) > 0:
        shaded = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
        u, v = first_uv(surfaces, prim_id, weights_at(surfaces, prim_id, point))
    material = material_of(surfaces, prim_id)
    row = surfaces.materials[material]
    colour, is_plain = three(row.colour), row.texture == CONSTANT and not row.has_colours
    set_vector(floats, ORIGIN, i, start)
    set_vector(floats, NORMAL, i, shaded)
    set_vector(floats, COLOUR, i, colour)
    floats[UV * STRIDE + i], floats[(UV + 1) * STRIDE + i] = u, v
    floats[LIGHT * STRIDE + i] = ZERO if is_plain or floats[SEEN * STRIDE + i] == ZERO else ONE
    floats[LENGTH * STRIDE + i] = np.float32(material)


@njit(forceinline=True)
def _find_images(chunk, i, surfaces):  # type: ignore[no-untyped-def]
    """Colours of those of eight pixels from the i-th on that see images; LIGHT is then 0."""
    address, row, zero = np.int64(chunk.floats.ctypes.data) + 4 * i, 4 * STRIDE, splat(0.0, _EIGHT)
    unknown = load(address + LIGHT * row, ZERO, _EIGHT)
    textured = unknown > splat(ZERO, _EIGHT)
    todo = bits_of(textured)
    if not todo:
        return
    materials = load(address + LENGTH * row, ZERO, _EIGHT)
    u, v = load(address + UV * row, ZERO, _EIGHT), load(address + (UV + 1) * row, ZERO, _EIGHT)
    while todo:
        k = 0
        while not todo >> k & 1:
            k += 1
        material = material_of(surfaces, np.int64(chunk.prim_id[i + k]))
        number = splat(np.float32(material), _EIGHT)
        own = textured & (materials >= number) & (number >= materials)
        todo &= ~bits_of(own)
        image = packed_image(surfaces, material)
        if image >= 0:
            x, y = places_in(surfaces, image, u, v)
            own = own & (x >= zero) & (y >= zero)
            colour = colours_at(surfaces, image, where(own, x, zero), where(own, y, zero))
            for channel in range(3):
                at = address + (COLOUR + channel) * row
                store(where(own, colour[channel], load(at, ZERO, _EIGHT)), at)
            unknown = where(own, splat(ZERO, _EIGHT), unknown)
    store(unknown, address + LIGHT * row)


@njit(forceinline=True)
def _find_colour(floats, i, prim_id, surfaces):  # type: ignore[no-untyped-def]
    """The i-th pixel's colour, with the colours of vertices."""
    material, point = material_of(surfaces, prim_id), vector_of(floats, ORIGIN, i)
    s, t = floats[UV * STRIDE + i], floats[(UV + 1) * STRIDE + i]
    colour = colour_at_inlined(surfaces, material, prim_id, point, s, t)
    if surfaces.materials[material].has_colours:
        tint = vertex_colour(surfaces, prim_id, weights_at(surfaces, prim_id, point))
        colour = colour[0] * tint[0], colour[1] * tint[1], colour[2] * tint[2]
    set_vector(floats, COLOUR, i, colour)


@njit(forceinline=True)
def _find_sky(floats, i, surfaces):  # type: ignore[no-untyped-def]
    """What the i-th pixel's surface reflects of the whole sky."""
    colour, normal = vector_of(floats, COLOUR, i), vector_of(floats, NORMAL, i)
    sky = sky_colour(surfaces, normal) if surfaces.sky[0] == GRADIENT else reflected(surfaces.harmonics, normal)
    set_vector(floats, SKY, i, (colour[0] * sky[0], colour[1] * sky[1], colour[2] * sky[2]))


@njit(forceinline=True)
def vector_of(floats, row, i):  # type: ignore[no-untyped-def]
    """Three numbers of the i-th pixel, from a row and the next two."""
    return floats[row * STRIDE + i], floats[(row + 1) * STRIDE + i], floats[(row + 2) * STRIDE + i]


@njit(forceinline=True)
def set_vector(floats, row, i, vector):  # type: ignore[no-untyped-def]
    """Write three numbers of the i-th pixel to a row and the next two."""
    floats[row * STRIDE + i], floats[(row + 1) * STRIDE + i], floats[(row + 2) * STRIDE + i] = vector


class Aim(NamedTuple):
    """The sample points of rays in the unit square.

    points: (N, 2) uint32, in units of 2^-32. is_traced: whether rays are traced for occlusion. length: float32, longest
    ray.
    """

    points: NDArray[np.uint32]
    is_traced: bool
    length: np.float32


@njit(forceinline=True)
def _set_ray(floats, i, direction, light, length, is_traced):  # type: ignore[no-untyped-def]
    """Write a pixel's ray and the light that it carries; returns 1 if it is traced, else 0."""
    set_vector(floats, DIRECTION, i, direction)
    floats[LENGTH * STRIDE + i] = length if is_traced else ZERO
    floats[LIGHT * STRIDE + i] = light
    return 1 if is_traced else 0


@njit(forceinline=True)
def _set_lit(floats, i, direction, strength, length):  # type: ignore[no-untyped-def]
    """Write a pixel's ray to a light; returns 1 if it carries any, else 0."""
    carried = dot(vector_of(floats, NORMAL, i), direction) * strength
    return _set_ray(floats, i, direction, carried if carried > ZERO else ZERO, length, carried > ZERO)


@float_part
def aim_at_light(floats, count, light, aim, number):  # type: ignore[no-untyped-def]
    """Aim a ray from each pixel's surface at a point of the light, the same for all. light: (LIGHT_WORDS,) float32.
    Returns how many may arrive."""
    rays, u, v = 0, unit_of(aim.points[number, 0]), unit_of(aim.points[number, 1])
    if light[KIND] == SUN:
        direction = to_sun(light, u, v)
        for i in range(count):
            rays += _set_lit(floats, i, direction, ONE, aim.length)
    else:
        for i in range(count):
            direction, strength, reach = to_lamp(light, vector_of(floats, ORIGIN, i), u, v)
            rays += _set_lit(floats, i, direction, strength, min(reach, aim.length))
    return rays


@float_part
def aim_into_sky(floats, first, count, is_cosine, aim, number):  # type: ignore[no-untyped-def]
    """Aim a ray from the surface of each pixel, from number `first` on, into its hemisphere, by a point that is shifted
    for each. Returns the number of rays."""
    rays = 0
    for i in range(count):
        key, normal = key_of(first + i, np.uint32(0)), vector_of(floats, NORMAL, i)
        u = np.uint32(aim.points[number, 0] + random_bits(key, 0))
        v = np.uint32(aim.points[number, 1] + random_bits(key, 1))
        direction = on_sphere(unit_of(u), unit_of(v))
        if is_cosine:
            direction = around(normal, direction)
        elif dot(direction, normal) < ZERO:
            direction = scaled(-ONE, direction)
        rays += _set_ray(floats, i, direction, ONE, aim.length, floats[SEEN * STRIDE + i] != ZERO)
    return rays
