"""What kernels of pictures share: the pixels' rays, and for paths a ray in a packet and light that arrives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.embree.layout import RAY_DIR_X, RAY_ID, RAY_ORG_X, RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    START,
    hit_distance,
    hit_prim_id,
    intersect,
    occluded,
    ray_component,
    set_no_hit,
)
from atra.light.emitters.emitters_kernels import FROM_LAMP, found_share, found_sky_share
from atra.light.emitters.sky_kernels import sky_colour
from atra.light.numbers_kernels import ONE, ZERO, along, bits_of, dot, key_of, scaled, set_vector, unit_of, vector
from atra.light.scattering.sampler_kernels import JITTER, LOBE, PAIRS, pair_of
from atra.light.scattering.spots_kernels import BLACK, WHITE, straight_light
from atra.light.surface_kernels import HOLES, ONE_SIDED, SOLID, emitted, material_of, meet, opacity_at

BLOCK = 2048
"""Pixels of a wave are a multiple. Packets stay within a block, which starts at a multiple of BLOCK pixels; so a ray
has the same packet, and Embree's answer the same bits, for any size of wave."""

TILE = 4
"""Side of the tiles in which pixels are taken; a packet's rays then start close together."""

_HOLES = 1 << 16
"""The first dimension of the hashes that decide which surfaces with HOLES a ray passes."""

_SEED = 0x2545F491

_BEYOND = np.float32(1 + 2.0**-23)
"""Where a ray starts again behind a hole, over the distance to it: the next float32 or the one after. Embree may find
the same triangle there once more; its number tells."""

_LEAST_SURVIVAL = np.float32(0.05)


class Pixels(NamedTuple):
    """Rays of the pixels of an image, and their hits.

    lines: (6, 3) float64, world space: origin and direction of pixel (0, 0)'s ray, then their change per pixel to the
    right, then per pixel down. places: (pixels,) uint32, x + y 2^16 of each pixel, in the order of work. jittered:
    whether each pixel has an offset of its own. prim_id: (>= pixels,) uint32, image rows `stride` apart; empty if rays
    are still to be traced. sample: its number. directions: (3, H, W) float32, world space, of a camera with a lens, in
    place of those of `lines`; (3, 0, 0) without.
    """

    lines: NDArray[np.float64]
    places: NDArray[np.uint32]
    jittered: bool
    prim_id: NDArray[np.uint32]
    stride: int
    sample: int
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
        across, down = pair_of(key_of(pixel, _SEED), pixels.sample, JITTER)
        x += across
        y += down
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
def path_key(pixel):  # type: ignore[no-untyped-def]
    """What tells the random numbers of a pixel's paths from another's."""
    return key_of(pixel, _SEED)


@njit(forceinline=True)
def load_ray(packet, width, lane, origin, direction, length, near=START):  # type: ignore[no-untyped-def]
    for axis in range(3):
        packet.floats[(RAY_ORG_X + axis) * width + lane] = origin[axis]
        packet.floats[(RAY_DIR_X + axis) * width + lane] = ray_component(direction[axis])
    packet.floats[RAY_TNEAR * width + lane] = near
    packet.floats[RAY_TFAR * width + lane] = length


@njit(forceinline=True)
def add_light(sums, pixel, weight, light):  # type: ignore[no-untyped-def]
    """Add weighted light to a pixel's sums; returns whether it was finite."""
    arrived = weight[0] * light[0], weight[1] * light[1], weight[2] * light[2]
    for channel in range(3):
        sums[channel, pixel] += arrived[channel]
    return arrived[0] < INFINITY and arrived[1] < INFINITY and arrived[2] < INFINITY


@njit
def arriving(surfaces, emitters, prim_id, origin, direction, density):  # type: ignore[no-untyped-def]
    """(r, g, b) of the sky or a triangle that shines, as far as it is left to scattering."""
    if prim_id == MISS:
        return scaled(found_sky_share(surfaces, emitters, direction, density), sky_colour(surfaces, direction))
    light = emitted(surfaces, prim_id, origin, direction)
    if not light[0] + light[1] + light[2] > ZERO:
        return light
    return scaled(found_share(surfaces, emitters, prim_id, origin, direction, density), light)


@njit(forceinline=True)
def passes_of(bounce):  # type: ignore[no-untyped-def]
    """Bits of `flags`, one of which a triangle has that a ray may pass; bounce: 0 for rays of the eye."""
    return HOLES | ONE_SIDED if bounce == 0 else HOLES


@njit(error_model="numpy")
def passed(surfaces, prim_id, origin, direction, weight, is_seen, random):  # type: ignore[no-untyped-def]
    """(passes, weight): whether a ray passes a triangle that light may pass, decided by chance; its origin stays, and
    it goes on `behind` the hit. weight: (r, g, b) of what goes on.

    is_seen: by the eye. random: (key, sample, number of surfaces met so far).
    """
    key, sample, number = random
    light, opacity = _straight(surfaces, prim_id, origin, direction, ZERO, is_seen, False)
    share = max(light[0], max(light[1], light[2]))
    if unit_of(bits_of(key ^ np.uint32(sample), np.uint32(_HOLES + number))) < share:
        return True, (weight[0] * light[0] / share, weight[1] * light[1] / share, weight[2] * light[2] / share)
    return False, scaled(opacity / (ONE - share), weight)


@njit(forceinline=True)
def behind(distance):  # type: ignore[no-untyped-def]
    """Where a ray goes on that has passed what it met at a distance, exact to one or two steps of float32: what stands
    close behind is met."""
    return distance * _BEYOND


@njit
def _straight(surfaces, prim_id, origin, direction, length, is_seen, is_lamp):  # type: ignore[no-untyped-def]
    """((r, g, b), opacity) where a ray meets a triangle: what passes straight on, and the share that meets the surface.
    length: of the way there within a solid, if this is its back. is_lamp: whether the light is that of a lamp, which
    passes SOLID glass, too."""
    point, _, is_front = meet(surfaces, prim_id, origin, direction)
    opacity = opacity_at(surfaces, prim_id, point, is_front, is_seen)
    light = ONE - opacity, ONE - opacity, ONE - opacity
    row = surfaces.materials[material_of(surfaces, prim_id)]
    if opacity > ZERO and row.transmission > ZERO:
        light = along(light, opacity, straight_light(surfaces, prim_id, origin, direction, length, is_lamp))
    return light, opacity


@njit(forceinline=True, error_model="numpy")
def survival(weight, key, sample, bounce):  # type: ignore[no-untyped-def]
    """By what a path's weight grows if it goes on, 0 if it ends here: Russian roulette by its weight."""
    odds = max(_LEAST_SURVIVAL, max(weight[0], max(weight[1], weight[2])))
    if odds >= ONE:
        return ONE
    return ONE / odds if pair_of(key, sample, bounce * PAIRS + LOBE)[1] < odds else ZERO


@njit(forceinline=True)
def _is_solid(surfaces, prim_id):  # type: ignore[no-untyped-def]
    """Whether a triangle bounds a solid that light may pass, and is no thin wall."""
    row = surfaces.materials[material_of(surfaces, prim_id)]
    return row.transmission > ZERO and not row.is_thin


FREE_LIGHT, FREE_LENGTH, FREE_KIND, FREE_SINCE = 0, 3, 4, 5
FREE_ROWS = 6
"""Rows of what `shadows` finds for the rays of a packet: the share of light that passes (r, g, b); scratch; set by the
caller, what they are aimed at, as of `aim`; scratch."""


@njit(forceinline=True)
def shadows(width, surfaces, scene, packet, free):  # type: ignore[no-untyped-def]
    """Find the share of light that passes along the valid rays of a packet of `width`, which are not valid afterwards.

    free: (FREE_ROWS, width) float32.
    """
    floats, valid = packet.floats, packet.valid
    if not surfaces.has_holes:
        occluded(width, valid, scene, packet)
        for lane in range(width):
            is_free = valid[lane] != 0 and floats[RAY_TFAR * width + lane] >= ZERO
            set_vector(free, FREE_LIGHT, lane, WHITE if is_free else BLACK)
        return
    waiting = 0
    for lane in range(width):
        set_vector(free, FREE_LIGHT, lane, WHITE if valid[lane] != 0 else BLACK)
        free[FREE_LENGTH, lane], free[FREE_SINCE, lane] = floats[RAY_TFAR * width + lane], ZERO
        packet.ids[RAY_ID * width + lane] = MISS
        waiting += 1 if valid[lane] != 0 else 0
    while waiting > 0:
        for lane in range(width):
            floats[RAY_TFAR * width + lane] = free[FREE_LENGTH, lane]
            set_no_hit(packet, width, lane)
        intersect(width, valid, scene, packet)
        for lane in range(width):
            if valid[lane] == 0:
                continue
            prim_id = hit_prim_id(packet, width, lane)
            light, beyond = WHITE, INFINITY
            if prim_id != MISS:
                is_lamp, distance = free[FREE_KIND, lane] == FROM_LAMP, hit_distance(packet, width, lane)
                beyond = behind(distance)
                if prim_id == packet.ids[RAY_ID * width + lane]:
                    pass
                elif surfaces.flags[prim_id] & (HOLES | SOLID if is_lamp else HOLES):
                    origin, direction = _ray_of(packet, width, lane)
                    length = distance - free[FREE_SINCE, lane]
                    light, _ = _straight(surfaces, prim_id, origin, direction, length, False, is_lamp)
                    if is_lamp and _is_solid(surfaces, prim_id):
                        free[FREE_SINCE, lane] = distance
                    packet.ids[RAY_ID * width + lane] = prim_id
                else:
                    light = BLACK
            for channel in range(3):
                free[FREE_LIGHT + channel, lane] *= light[channel]
            floats[RAY_TNEAR * width + lane] = beyond
            if not dot(vector(free, FREE_LIGHT, lane), WHITE) > ZERO or beyond >= free[FREE_LENGTH, lane]:
                valid[lane] = 0
                waiting -= 1


@njit(forceinline=True)
def _ray_of(packet, width, lane):  # type: ignore[no-untyped-def]
    """(origin, direction) of a ray in a packet."""
    floats = packet.floats
    return (
        (
            floats[RAY_ORG_X * width + lane],
            floats[(RAY_ORG_X + 1) * width + lane],
            floats[(RAY_ORG_X + 2) * width + lane],
        ),
        (
            floats[RAY_DIR_X * width + lane],
            floats[(RAY_DIR_X + 1) * width + lane],
            floats[(RAY_DIR_X + 2) * width + lane],
        ),
    )
