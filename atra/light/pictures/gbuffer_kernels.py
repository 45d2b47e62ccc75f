"""The G-buffer: what pixels see, with origins of further rays, normals and colours, before any light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.memory import gather_at, halves, load, low_and_high, prefetch, store, table_columns
from atra.compiled.store import float_part, njit
from atra.compiled.vectors import bits_of, fused, root, rounded, splat, where, widened
from atra.light.emitters.background_kernels import background
from atra.light.emitters.harmonics_kernels import reflected
from atra.light.numbers_kernels import HALF, ONE, ZERO, unit
from atra.light.pictures.path_kernels import FREE_ROWS, TILE, pixel_line, place_of
from atra.light.scattering.texels_kernels import checkered, colours_at, fetch_texels, packed_image, places_in
from atra.light.surface_kernels import (
    CHECKER,
    GRADIENT,
    HAS_COLOURS,
    LEAST_SQUARED,
    TEXTURE,
    TINY,
    colour_at_inlined,
    material_of,
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

_LANES = 8


class Chunk(NamedTuple):
    """The G-buffer of at most `CHUNK` pixels, and one ray from each.

    floats: (_ROWS x STRIDE,) float32, row by row. Three rows each: ORIGIN of rays; shading NORMAL, 0 for a miss;
    COLOUR; SKY, the colour times the sky's light there, or the sky that the pixel sees; DIRECTION of the ray. LENGTH of
    the ray, 0 = none. LIGHT: what the ray carries, 0 once it is blocked. SEEN: 1, or 0 for a miss. UV: two rows, if
    vertices have uv. prim_id: (STRIDE,) uint32, 0 for a miss. free: (FREE_ROWS, LANES) float32, as for `shadows`.
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
    for i in range(0, count, _LANES):
        _look_up(chunk, i, first + i, pixels)


@float_part
def find_surfaces(chunk, first, count, pixels, surfaces):  # type: ignore[no-untyped-def]
    """Fill the chunk with what `count` pixels from number `first` on see of its triangles."""
    for i in range(0, count, _LANES):
        _find_places(chunk, i, first + i, pixels, surfaces)
    for i in range(0, count, _LANES):
        textured = _find_images(chunk, i, surfaces)
        left = textured if surfaces.sky[0] == GRADIENT else (1 << _LANES) - 1
        if left:
            for k in range(min(_LANES, count - i)):
                if left >> k & 1:
                    _find_colour(chunk, i + k, first + i + k, textured >> k & 1, pixels, surfaces)


@njit(forceinline=True)
def _at(lines, row, axis, x, y):  # type: ignore[no-untyped-def]
    """`line_at` for `_LANES` pixels, one axis, in unrounded float64."""
    start, right, down = lines[row, axis], lines[row + 2, axis], lines[row + 4, axis]
    return fused(y, splat(down, _LANES), fused(x, splat(right, _LANES), splat(start, _LANES)))


@njit(forceinline=True)
def _dot(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    return fused(az, bz, fused(ay, by, ax * bx))


@njit(forceinline=True)
def _gradient(sky, axis, height):  # type: ignore[no-untyped-def]
    """`sky_colour` for `_LANES` pixels, one channel. height: y of unit vectors."""
    above = fused(height, splat(HALF, _LANES), splat(HALF, _LANES))
    below = splat(ONE, _LANES) - above
    return fused(below, splat(sky[1 + axis], _LANES), above * splat(sky[4 + axis], _LANES))


@njit(forceinline=True)
def _look_up(chunk, i, pixel, pixels):  # type: ignore[no-untyped-def]
    """Which triangles `_LANES` pixels see, from the i-th of the chunk on."""
    x, y = low_and_high(np.int64(pixels.places.ctypes.data) + 4 * pixel)
    stride = splat(np.float64(pixels.stride), _LANES)
    found = gather_at(np.int64(pixels.prim_id.ctypes.data), fused(y, stride, x))
    is_seen = found >= found  # MISS has the bits of a NaN
    none = splat(ZERO, _LANES)
    store(where(is_seen, found, none), np.int64(chunk.prim_id.ctypes.data) + 4 * i)
    seen = np.int64(chunk.floats.ctypes.data) + 4 * (SEEN * STRIDE + i)
    store(where(is_seen, splat(ONE, _LANES), none), seen)


@njit(forceinline=True)
def _find_places(chunk, i, pixel, pixels, surfaces):  # type: ignore[no-untyped-def]
    """`meet`, `leaving`, colours and a gradient sky for `_LANES` pixels at once, in float64: float32 could push points
    through a surface. Where LIGHT is 1, colours are unknown, and SKY is the sky's alone; LENGTH has their materials.
    """
    address, row = np.int64(chunk.floats.ctypes.data) + 4 * i, 4 * STRIDE
    numbers = np.int64(chunk.prim_id.ctypes.data) + 4 * i
    x, y = low_and_high(np.int64(pixels.places.ctypes.data) + 4 * pixel)
    zero, none, one = splat(0.0, _LANES), splat(ZERO, _LANES), splat(ONE, _LANES)
    seen = load(address + SEEN * row, ZERO, _LANES) > none
    lines = pixels.lines
    ox, oy, oz = _at(lines, 0, 0, x, y), _at(lines, 0, 1, x, y), _at(lines, 0, 2, x, y)
    if pixels.directions.shape[1] > 0:
        width, plane = pixels.directions.shape[2], 4 * pixels.directions.shape[1] * pixels.directions.shape[2]
        place, ways = fused(y, splat(np.float64(width), _LANES), x), np.int64(pixels.directions.ctypes.data)
        dx, dy = widened(gather_at(ways, place)), widened(gather_at(ways + plane, place))
        dz = widened(gather_at(ways + 2 * plane, place))
    else:
        dx, dy, dz = _at(lines, 1, 0, x, y), _at(lines, 1, 1, x, y), _at(lines, 1, 2, x, y)
    nx, ny, nz, plane, off, materials, colours, more = table_columns(np.int64(surfaces.records.ctypes.data), numbers)
    facing, tiny = _dot(nx, ny, nz, dx, dy, dz), splat(TINY, _LANES)
    t = (plane - _dot(nx, ny, nz, ox, oy, oz)) / where(abs(facing) > tiny, facing, tiny)
    side = where(facing >= zero, splat(-1.0, _LANES), splat(1.0, _LANES))
    nx, ny, nz = side * nx, side * ny, side * nz
    px, py, pz = fused(t, dx, ox), fused(t, dy, oy), fused(t, dz, oz)
    store(rounded(fused(off, nx, px)), address + ORIGIN * row)
    store(rounded(fused(off, ny, py)), address + (ORIGIN + 1) * row)
    store(rounded(fused(off, nz, pz)), address + (ORIGIN + 2) * row)
    nx, ny, nz = rounded(nx), rounded(ny), rounded(nz)
    u = v = none
    if len(surfaces.weights) > 0:
        (nx, ny, nz), (u, v) = _between_corners(nx, ny, nz, px, py, pz, dx, dy, dz, rounded(side), numbers, surfaces)
        store(u, address + UV * row)
        store(v, address + (UV + 1) * row)
    height = ny
    store(where(seen, nx, none), address + NORMAL * row)
    store(where(seen, ny, none), address + (NORMAL + 1) * row)
    store(where(seen, nz, none), address + (NORMAL + 2) * row)
    red, green = halves(colours)
    blue, is_plain = halves(more)
    textured = seen & (none >= is_plain)
    left = bits_of(textured)
    while left:
        material = _first_material(chunk, i, left, surfaces)
        number = splat(np.float64(material), _LANES)
        own = textured & (materials >= number) & (number >= materials)
        left &= ~bits_of(own)
        if surfaces.materials[material, TEXTURE] == CHECKER:
            red, green, blue = checkered(own, red, green, blue, u, v, material, surfaces)
            textured = textured & ((materials > number) | (number > materials))
        else:
            image = packed_image(surfaces, material)
            if image >= 0:
                x, y = places_in(surfaces, image, u, v)
                own = own & (x >= zero) & (y >= zero)
                fetch_texels(surfaces, image, where(own, x, zero), where(own, y, zero))
    store(where(textured, one, none), address + LIGHT * row)
    store(rounded(materials), address + LENGTH * row)
    store(red, address + COLOUR * row)
    store(green, address + (COLOUR + 1) * row)
    store(blue, address + (COLOUR + 2) * row)
    sky, is_seen = surfaces.sky, bits_of(seen)
    if is_seen != (1 << _LANES) - 1:
        height = where(seen, height, rounded(dy / root(_dot(dx, dy, dz, dx, dy, dz))))
        red, green, blue = where(seen, red, one), where(seen, green, one), where(seen, blue, one)
    red, green, blue = where(textured, one, red), where(textured, one, green), where(textured, one, blue)
    store(red * _gradient(sky, 0, height), address + SKY * row)
    store(green * _gradient(sky, 1, height), address + (SKY + 1) * row)
    store(blue * _gradient(sky, 2, height), address + (SKY + 2) * row)


@njit(forceinline=True)
def _first_material(chunk, i, lanes, surfaces):  # type: ignore[no-untyped-def]
    """The material that the first of those pixels sees whose bits are set, at least one."""
    k = 0
    while not lanes >> k & 1:
        k += 1
    return material_of(surfaces, np.int64(chunk.prim_id[i + k]))


@njit(forceinline=True)
def _find_images(chunk, i, surfaces):  # type: ignore[no-untyped-def]
    """Colours and sky of those of `_LANES` pixels that see images; the bits of pixels whose colours are unknown."""
    address, row, zero = np.int64(chunk.floats.ctypes.data) + 4 * i, 4 * STRIDE, splat(0.0, _LANES)
    textured = load(address + LIGHT * row, ZERO, _LANES) > splat(ZERO, _LANES)
    left = todo = bits_of(textured)
    if not left:
        return left
    materials = load(address + LENGTH * row, ZERO, _LANES)
    u, v = load(address + UV * row, ZERO, _LANES), load(address + (UV + 1) * row, ZERO, _LANES)
    while todo:
        material = _first_material(chunk, i, todo, surfaces)
        number = splat(np.float32(material), _LANES)
        own = textured & (materials >= number) & (number >= materials)
        todo &= ~bits_of(own)
        image = packed_image(surfaces, material)
        if image >= 0:
            x, y = places_in(surfaces, image, u, v)
            own = own & (x >= zero) & (y >= zero)
            colour = colours_at(surfaces, image, where(own, x, zero), where(own, y, zero))
            for channel in range(3):
                at = address + (COLOUR + channel) * row
                store(where(own, colour[channel], load(at, ZERO, _LANES)), at)
                at = address + (SKY + channel) * row
                sky = load(at, ZERO, _LANES)
                store(where(own, colour[channel] * sky, sky), at)
            left &= ~bits_of(own)
    return left


@njit(forceinline=True)
def _between_corners(nx, ny, nz, px, py, pz, dx, dy, dz, side, numbers, surfaces):  # type: ignore[no-untyped-def]
    """`shading_normal` and uv for `_LANES` pixels."""
    vx, vy, vz, v, wx, wy, wz, w = table_columns(np.int64(surfaces.weights.ctypes.data), numbers)
    pairs = table_columns(np.int64(surfaces.corners.ctypes.data), numbers)
    (ax, ay), (az, bx), (by, bz), (cx, cy) = halves(pairs[0]), halves(pairs[1]), halves(pairs[2]), halves(pairs[3])
    (cz, a_s), (a_t, b_s), (b_t, c_s), (c_t, _) = halves(pairs[4]), halves(pairs[5]), halves(pairs[6]), halves(pairs[7])
    v, w = fused(vx, px, fused(vy, py, fused(vz, pz, v))), fused(wx, px, fused(wy, py, fused(wz, pz, w)))
    u, v, w = rounded(splat(1.0, _LANES) - v - w), rounded(v), rounded(w)
    x, y, z = _dot(u, v, w, ax, bx, cx), _dot(u, v, w, ay, by, cy), _dot(u, v, w, az, bz, cz)
    squared = _dot(x, y, z, x, y, z)
    factor = side / root(squared)
    x, y, z = factor * x, factor * y, factor * z
    away = _dot(x, y, z, rounded(dx), rounded(dy), rounded(dz))
    is_own = (splat(LEAST_SQUARED, _LANES) >= squared) | (away >= splat(ZERO, _LANES))
    normal = where(is_own, nx, x), where(is_own, ny, y), where(is_own, nz, z)
    return normal, (_dot(u, v, w, a_s, b_s, c_s), _dot(u, v, w, a_t, b_t, c_t))


@njit(forceinline=True)
def vector_of(floats, row, i):  # type: ignore[no-untyped-def]
    """Three numbers of the i-th pixel, from a row and the next two."""
    return floats[row * STRIDE + i], floats[(row + 1) * STRIDE + i], floats[(row + 2) * STRIDE + i]


@njit(forceinline=True)
def set_vector(floats, row, i, vector):  # type: ignore[no-untyped-def]
    """Write three numbers of the i-th pixel to a row and the next two."""
    floats[row * STRIDE + i], floats[(row + 1) * STRIDE + i], floats[(row + 2) * STRIDE + i] = vector


@njit(forceinline=True)
def _find_colour(chunk, i, pixel, is_textured, pixels, surfaces):  # type: ignore[no-untyped-def]
    """A pixel's colour, if it is textured and still unknown, and its share of the sky."""
    floats = chunk.floats
    if floats[SEEN * STRIDE + i] == ZERO:
        _, direction = pixel_line(pixels, pixel)
        set_vector(floats, SKY, i, background(surfaces, unit(direction)))
        return
    if is_textured:
        prim_id, point = np.int64(chunk.prim_id[i]), vector_of(floats, ORIGIN, i)
        s, t = floats[UV * STRIDE + i], floats[(UV + 1) * STRIDE + i]
        material = material_of(surfaces, prim_id)
        colour = colour_at_inlined(surfaces, material, prim_id, point, s, t)
        if surfaces.materials[material, HAS_COLOURS] != 0.0:
            tint = vertex_colour(surfaces, prim_id, weights_at(surfaces, prim_id, point))
            colour = colour[0] * tint[0], colour[1] * tint[1], colour[2] * tint[2]
        set_vector(floats, COLOUR, i, colour)
    colour, sky = vector_of(floats, COLOUR, i), vector_of(floats, SKY, i)
    if surfaces.sky[0] != GRADIENT:
        sky = reflected(surfaces.harmonics, vector_of(floats, NORMAL, i))
    set_vector(floats, SKY, i, (colour[0] * sky[0], colour[1] * sky[1], colour[2] * sky[2]))
