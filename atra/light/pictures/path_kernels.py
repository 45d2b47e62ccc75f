"""What kernels of pictures share: the pixels' rays, and for paths a ray in a packet and light that arrives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.embree.layout import RAY_DIR_X, RAY_ORG_X, RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    START,
    ray_component,
)
from atra.light.emitters.emitters_kernels import found_share, found_sky_share
from atra.light.numbers_kernels import bits_of, key_of, scaled, unit_of
from atra.light.scattering_kernels import emitted
from atra.light.surface_kernels import sky_colour

BLOCK = 2048
"""Rays compacted together. Packets stay within a block, which starts at a multiple of BLOCK pixels; so a ray has the
same packet, and Embree's answer the same bits, for any size of wave."""

TILE = 4
"""Side of the tiles in which pixels are taken; a packet's rays then start close together."""

ROW_PADDING = 80
"""Extra columns of a wave; rows a power of two apart would compete for the same cache sets."""

_JITTER = np.uint32(0xFFFFFFFE)
"""First of two random dimensions of a pixel's own jitter; those of bounces count from 0."""


class Pixels(NamedTuple):
    """Rays of the pixels of an image, and their hits.

    lines: (6, 3) float64, world space: origin and direction of pixel (0, 0)'s ray, then their change per pixel to the
    right, then per pixel down. places: (pixels,) uint32, x + y 2^16 of each pixel, in the order of work. jittered:
    whether each pixel has an offset of its own. prim_id: (>= pixels,) uint32, image rows `stride` apart; empty if rays
    are still to be traced. sample_key: uint32. directions: (3, H, W) float32, world space, of a camera with a lens, in
    place of those of `lines`; (3, 0, 0) without.
    """

    lines: NDArray[np.float64]
    places: NDArray[np.uint32]
    jittered: bool
    prim_id: NDArray[np.uint32]
    stride: int
    sample_key: int
    directions: NDArray[np.float32]


@njit(forceinline=True)
def place_of(pixels, pixel):  # type: ignore[no-untyped-def]
    """(x, y) of a pixel."""
    place = pixels.places[pixel]
    return np.int64(place & np.uint32(0xFFFF)), np.int64(place >> np.uint32(16))


@njit(forceinline=True)
def seen_by(pixels, pixel):  # type: ignore[no-untyped-def]
    """The prim_id that a pixel sees."""
    x, y = place_of(pixels, pixel)
    return pixels.prim_id[y * pixels.stride + x]


@njit(forceinline=True)
def pixel_line(pixels, pixel):  # type: ignore[no-untyped-def]
    """(origin, direction), float32, of a pixel's ray; the direction is not normalised."""
    column, row = place_of(pixels, pixel)
    x, y = np.float64(column), np.float64(row)
    if pixels.directions.shape[1] > 0:
        origin, _ = line_at(pixels.lines, x, y)
        ways = pixels.directions
        return origin, (ways[0, row, column], ways[1, row, column], ways[2, row, column])
    if pixels.jittered:
        key = key_of(pixel, pixels.sample_key)
        x += unit_of(bits_of(key, _JITTER))
        y += unit_of(bits_of(key, _JITTER + np.uint32(1)))
    return line_at(pixels.lines, x, y)


@njit(forceinline=True)
def line_at(lines, x, y):  # type: ignore[no-untyped-def]
    """As `pixel_line`, at a float64 position."""
    origin = (
        np.float32(lines[0, 0] + x * lines[2, 0] + y * lines[4, 0]),
        np.float32(lines[0, 1] + x * lines[2, 1] + y * lines[4, 1]),
        np.float32(lines[0, 2] + x * lines[2, 2] + y * lines[4, 2]),
    )
    direction = (
        np.float32(lines[1, 0] + x * lines[3, 0] + y * lines[5, 0]),
        np.float32(lines[1, 1] + x * lines[3, 1] + y * lines[5, 1]),
        np.float32(lines[1, 2] + x * lines[3, 2] + y * lines[5, 2]),
    )
    return origin, direction


@njit(forceinline=True)
def load_ray(packet, width, lane, origin, direction, length):  # type: ignore[no-untyped-def]
    for axis in range(3):
        packet.floats[(RAY_ORG_X + axis) * width + lane] = origin[axis]
        packet.floats[(RAY_DIR_X + axis) * width + lane] = ray_component(direction[axis])
    packet.floats[RAY_TNEAR * width + lane] = START
    packet.floats[RAY_TFAR * width + lane] = length


@njit(forceinline=True)
def load_rays(packet, width, floats, origin, direction, first):  # type: ignore[no-untyped-def]
    """Load rays from number `first` on into the lanes of a packet."""
    for axis in range(3):
        for lane in range(width):
            packet.floats[(RAY_ORG_X + axis) * width + lane] = floats[origin + axis, first + lane]
            packet.floats[(RAY_DIR_X + axis) * width + lane] = ray_component(floats[direction + axis, first + lane])
    for lane in range(width):
        packet.floats[RAY_TNEAR * width + lane] = START


@njit(forceinline=True)
def add_light(sums, pixel, weight, light):  # type: ignore[no-untyped-def]
    """Add weighted light to a pixel's sums; returns whether it was finite."""
    arrived = weight[0] * light[0], weight[1] * light[1], weight[2] * light[2]
    for channel in range(3):
        sums[channel, pixel] += arrived[channel]
    return arrived[0] < INFINITY and arrived[1] < INFINITY and arrived[2] < INFINITY


@njit(forceinline=True)
def arriving(surfaces, emitters, prim_id, origin, direction, density):  # type: ignore[no-untyped-def]
    """(r, g, b) of the sky or an emissive triangle, as far as it is left to scattering."""
    if prim_id == MISS:
        return scaled(found_sky_share(emitters, direction, density), sky_colour(surfaces, direction))
    share = found_share(surfaces, emitters, prim_id, origin, direction, density)
    return scaled(share, emitted(surfaces, prim_id, origin, direction))
