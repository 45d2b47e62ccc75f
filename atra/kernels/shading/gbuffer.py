"""What pixels see: where rays to lights and sky start, normals, and colours, before any light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.kernels.caching import float_kernel
from atra.kernels.packets import MISS
from atra.kernels.raster.memory import gather_rows, load, store
from atra.kernels.raster.vectors import repeated, rounded, where, widened
from atra.kernels.shading.numbers import ZERO, unit
from atra.kernels.shading.paths import line_at, place_of
from atra.kernels.shading.surface import (
    CONSTANT,
    RECORD_WORDS,
    TEXTURE,
    TINY,
    colour_of,
    material_of,
    meet,
    plain_colour,
    shading_normal,
    sky_colour,
)

ORIGIN, NORMAL, COLOUR, SKY, DIRECTION = 0, 3, 6, 9, 12
WAVE_ROWS = 15

_LANES = 8
_RECORD_BYTES = 8 * RECORD_WORDS


class Wave(NamedTuple):
    """What N pixels see, and one ray from each.

    All have `ROW_PADDING` columns more, for whole packets. floats: (WAVE_ROWS, N) float32, three rows each: origin of
    rays, shading normal, colour, that times the sky's where the normal points, direction of the ray. Where nothing is
    seen, the fourth is the sky's that the pixel's ray meets.
    prim_id: (N,) uint32, 0 for a miss. is_hit: (N,) int32, -1 or 0. length: (N,) float32, how far the ray reaches, 0 =
    there is none. light: (N,) float32, what it carries if nothing is in its way; 0 once something is.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    is_hit: NDArray[np.int32]
    length: NDArray[np.float32]
    light: NDArray[np.float32]


@float_kernel
def find_surfaces(wave, first, count, pixels, surfaces):  # type: ignore[no-untyped-def]
    """What `count` pixels from number `first` on see, from the `prim_id` of `pixels`."""
    for i in range(count):
        x, y = place_of(pixels, first + i)
        prim_id = pixels.prim_id[y * pixels.stride + x]
        is_hit = prim_id != MISS
        wave.is_hit[i] = -1 if is_hit else 0
        wave.prim_id[i] = prim_id if is_hit else 0
        wave.floats[DIRECTION, i], wave.floats[DIRECTION + 1, i] = np.float32(x), np.float32(y)  # until rays are made
    for i in range(0, count, _LANES):
        _find_places(wave, i, pixels.lines, surfaces.records)
    _find_colours(wave, count, pixels.lines, surfaces)


@njit(inline="always")
def _address(floats, row, i):  # type: ignore[no-untyped-def]
    return np.int64(floats.ctypes.data) + row * floats.strides[0] + 4 * i


@njit(inline="always")
def _at(lines, row, axis, x, y):  # type: ignore[no-untyped-def]
    """`line_at` of `_LANES` pixels: one axis, as float64."""
    start, right, down = lines[row, axis], lines[row + 2, axis], lines[row + 4, axis]
    value = repeated(start, _LANES) + x * repeated(right, _LANES) + y * repeated(down, _LANES)
    return widened(rounded(value))


@njit(inline="always")
def _find_places(wave, i, lines, records):  # type: ignore[no-untyped-def]
    """Origins of rays and normals of `_LANES` triangles from the i-th pixel on: `meet` and `leaving` side by side."""
    floats = wave.floats
    x = widened(load(_address(floats, DIRECTION, i), np.float32(0), _LANES))
    y = widened(load(_address(floats, DIRECTION + 1, i), np.float32(0), _LANES))
    ox, oy, oz = _at(lines, 0, 0, x, y), _at(lines, 0, 1, x, y), _at(lines, 0, 2, x, y)
    dx, dy, dz = _at(lines, 1, 0, x, y), _at(lines, 1, 1, x, y), _at(lines, 1, 2, x, y)
    numbers, base = np.int64(wave.prim_id.ctypes.data) + 4 * i, np.int64(records.ctypes.data)
    nx = gather_rows(base, numbers, _RECORD_BYTES)
    ny = gather_rows(base + 8, numbers, _RECORD_BYTES)
    nz = gather_rows(base + 16, numbers, _RECORD_BYTES)
    plane = gather_rows(base + 24, numbers, _RECORD_BYTES)
    off = gather_rows(base + 32, numbers, _RECORD_BYTES)
    zero, tiny = repeated(0.0, _LANES), repeated(TINY, _LANES)
    facing = nx * dx + ny * dy + nz * dz
    ahead = plane - (nx * ox + ny * oy + nz * oz)
    t = ahead / where((facing > tiny) | (zero - facing > tiny), facing, tiny)
    side = where(facing >= zero, repeated(-1.0, _LANES), repeated(1.0, _LANES))
    nx, ny, nz = rounded(side * nx), rounded(side * ny), rounded(side * nz)
    store(rounded(ox + t * dx + off * widened(nx)), _address(floats, ORIGIN, i))
    store(rounded(oy + t * dy + off * widened(ny)), _address(floats, ORIGIN + 1, i))
    store(rounded(oz + t * dz + off * widened(nz)), _address(floats, ORIGIN + 2, i))
    store(nx, _address(floats, NORMAL, i))
    store(ny, _address(floats, NORMAL + 1, i))
    store(nz, _address(floats, NORMAL + 2, i))


@njit(inline="always")
def _set_row(floats, first, i, vector):  # type: ignore[no-untyped-def]
    floats[first, i], floats[first + 1, i], floats[first + 2, i] = vector


@njit(inline="always")
def _find_colours(wave, count, lines, surfaces):  # type: ignore[no-untyped-def]
    """Colours, and normals that vertices give. Neighbours often see one triangle, which has them all alike if it is
    flat and of one colour."""
    floats, is_flat = wave.floats, len(surfaces.normals) == 0
    colour = arrived = ZERO, ZERO, ZERO
    last = np.int64(-1)
    for i in range(count):
        prim_id = np.int64(wave.prim_id[i])
        x, y = np.float64(floats[DIRECTION, i]), np.float64(floats[DIRECTION + 1, i])
        if wave.is_hit[i] == 0:
            _, direction = line_at(lines, x, y)
            _set_row(floats, SKY, i, sky_colour(surfaces, unit(direction)))
            continue
        if prim_id != last:
            material = material_of(surfaces, prim_id)
            normal = floats[NORMAL, i], floats[NORMAL + 1, i], floats[NORMAL + 2, i]
            if is_flat and surfaces.materials[material, TEXTURE] == CONSTANT:
                colour = plain_colour(surfaces, material)
                last = prim_id
            else:
                origin, direction = line_at(lines, x, y)
                point, normal, is_front = meet(surfaces, prim_id, origin, direction)
                normal = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
                _set_row(floats, NORMAL, i, normal)
                colour = colour_of(surfaces, material, prim_id, point)
                last = np.int64(-1)
            sky = sky_colour(surfaces, normal)
            arrived = colour[0] * sky[0], colour[1] * sky[1], colour[2] * sky[2]
        _set_row(floats, COLOUR, i, colour)
        _set_row(floats, SKY, i, arrived)
