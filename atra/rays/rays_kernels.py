"""The loops over batches of rays that come from no camera: closest hits and occlusion."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import fetch_add, float_at
from atra.compiled.store import float_kernel, kernel, njit
from atra.embree.layout import (
    FLAG_COHERENT,
    RAY_DIR_X,
    RAY_DIR_Y,
    RAY_DIR_Z,
    RAY_ORG_X,
    RAY_ORG_Y,
    RAY_ORG_Z,
    RAY_TFAR,
    RAY_TNEAR,
)
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    hit_distance,
    hit_prim_id,
    intersect,
    occluded,
    ray_component,
    set_no_hit,
)

CHUNK = 512
"""Rays a thread takes at a time: whole packets of any width, so that any number of threads makes the same packets."""

NEVER, ALWAYS, WHERE_ALIKE = 0, 1, 2
"""Whether Embree takes the rays of a packet through its tree together."""

ALIKE_DIRECTIONS = np.float32(0.125)
"""How far apart the components of directions of 1 to 2 in size are for rays of a packet to head alike."""


class RaysInMemory(NamedTuple):
    """Rays, as they are traced one after the other: where their numbers, float32, lie in memory.

    origins, directions: address of the first ray's three numbers; a ray's are `vector_bytes` behind those of the one
    before. tnear, tfar: address of the first ray's, in lengths of the direction; the next is `number_bytes` behind.
    together: `NEVER`, `ALWAYS` or `WHERE_ALIKE`. near_by: how far apart origins are at most to count as alike.
    """

    origins: int
    directions: int
    vector_bytes: int
    tnear: int
    tfar: int
    number_bytes: int
    together: int
    near_by: np.float32


@kernel
def first_unfit(vectors, shortest, longest, smallest):  # type: ignore[no-untyped-def]
    """The first of vectors (N, 3) whose largest component is not from `shortest` to `longest` in size; N: all are.
    Components below `smallest` in size become 0."""
    for ray in range(len(vectors)):
        x, y, z = abs(vectors[ray, 0]), abs(vectors[ray, 1]), abs(vectors[ray, 2])
        is_long = (x >= shortest) | (y >= shortest) | (z >= shortest)
        if not (is_long & (x <= longest) & (y <= longest) & (z <= longest)):  # so neither is NaN
            return ray
        if (x < smallest) | (y < smallest) | (z < smallest):
            for axis in range(3):
                if abs(vectors[ray, axis]) < smallest:
                    vectors[ray, axis] = 0.0
    return len(vectors)


@njit(forceinline=True)
def ray_length(directions, ray):  # type: ignore[no-untyped-def]
    """(l, 1 / l): the largest power of two that no component of the direction is below, all of them being less."""
    return _length(directions[ray, 0], directions[ray, 1], directions[ray, 2])


@njit(forceinline=True)
def _length(x, y, z):  # type: ignore[no-untyped-def]
    largest = np.float32(max(abs(x), abs(y), abs(z)))
    exponent = np.uint32(largest.view(np.uint32) & 0x7F800000)
    return exponent.view(np.float32), np.uint32(0x7F000000 - exponent).view(np.float32)


@njit(forceinline=True)
def _origin(rays, ray):  # type: ignore[no-untyped-def]
    first = rays.origins + rays.vector_bytes * ray
    return float_at(first), float_at(first + 4), float_at(first + 8)


@njit(forceinline=True)
def _direction(rays, ray):  # type: ignore[no-untyped-def]
    first = rays.directions + rays.vector_bytes * ray
    return float_at(first), float_at(first + 4), float_at(first + 8)


@njit(forceinline=True)
def _load(packet, width, lane, rays, ray):  # type: ignore[no-untyped-def]
    """Put a ray into a lane; returns whether it is of any length, and leaves `valid` of the lane so.

    Its direction is brought to a largest component of 1 to 2 by a power of two, and its ends to match: no bit of a hit
    then depends on the length of the direction, and what is tiny (`ray_component`) is so for all. Embree would lose
    short directions, and long ones would leave the range of float32. Origins stay as they are: tiny ones lose nothing.
    """
    x, y, z = _direction(rays, ray)
    length, inverse = _length(x, y, z)
    floats = packet.floats
    floats[RAY_ORG_X * width + lane], floats[RAY_ORG_Y * width + lane], floats[RAY_ORG_Z * width + lane] = _origin(
        rays, ray
    )
    floats[RAY_DIR_X * width + lane] = ray_component(x * inverse)
    floats[RAY_DIR_Y * width + lane] = ray_component(y * inverse)
    floats[RAY_DIR_Z * width + lane] = ray_component(z * inverse)
    near = float_at(rays.tnear + rays.number_bytes * ray) * length
    far = float_at(rays.tfar + rays.number_bytes * ray) * length
    floats[RAY_TNEAR * width + lane] = near
    floats[RAY_TFAR * width + lane] = far
    is_open = near < far
    packet.valid[lane] = -1 if is_open else 0
    return is_open


@njit(forceinline=True)
def _are_alike(rays, first, lanes):  # type: ignore[no-untyped-def]
    """Whether so many rays start and head alike, as neighbours of a camera do."""
    x, y, z = _origin(rays, first)
    u, v, w = _direction(rays, first)
    _, inverse = _length(u, v, w)
    for ray in range(first + 1, first + lanes):
        a, b, c = _origin(rays, ray)
        moved = max(abs(a - x), abs(b - y), abs(c - z))
        a, b, c = _direction(rays, ray)
        turned = max(abs(a - u), abs(b - v), abs(c - w)) * inverse
        if not (turned <= ALIKE_DIRECTIONS and moved <= rays.near_by):
            return False
    return True


@kernel
def places_alike(rays, count, places, neighbours):  # type: ignore[no-untyped-def]
    """At how many places, evenly over a batch of `count` rays, so many neighbours start and head alike."""
    alike = 0
    for place in range(places):
        first = (count - neighbours) * place // (places - 1)
        alike += _are_alike(rays, first, neighbours)
    return alike


@njit(forceinline=True)
def _set_flags(flags, rays, first, lanes):  # type: ignore[no-untyped-def]
    if rays.together == WHERE_ALIKE:
        others = flags[0] & ~np.uint32(FLAG_COHERENT)
        flags[0] = others | (FLAG_COHERENT if _are_alike(rays, first, lanes) else 0)


@cache
def closest_hit_kernel(width: int) -> Callable[..., None]:
    """The loop over rays for their closest hits, in packets of `width`, a constant of the compiled code."""

    @float_kernel
    def intersect_rays(counter_address, scene, packet, flags, rays, t, prim_id):  # type: ignore[no-untyped-def]
        """Trace all rays, chunk by chunk, until the shared counter runs past the last.

        packet: its constant fields (mask, flags, inst_id) are set. flags: (1,) uint32, of the query, which are set for
        each packet where that is asked for. rays: `RaysInMemory`.
        t: (N,) float32 and prim_id: (N,) uint32 are written completely, inf and MISS where nothing is hit.
        """
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= len(t):
                return
            for first in range(start, min(start + CHUNK, len(t)), width):
                lanes = min(width, len(t) - first)
                anyone = False
                for lane in range(width):
                    set_no_hit(packet, width, lane)
                    packet.valid[lane] = 0
                for lane in range(lanes):
                    anyone |= _load(packet, width, lane, rays, first + lane)
                if anyone:
                    _set_flags(flags, rays, first, lanes)
                    intersect(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    found = hit_prim_id(packet, width, lane)
                    prim_id[first + lane] = found
                    x, y, z = _direction(rays, first + lane)
                    _, inverse = _length(x, y, z)
                    t[first + lane] = hit_distance(packet, width, lane) * inverse if found != MISS else INFINITY

    return intersect_rays


@cache
def occlusion_kernel(width: int) -> Callable[..., None]:
    """The loop over rays for whether they hit anything; arguments as for `closest_hit_kernel`."""

    @float_kernel
    def occlude_rays(counter_address, scene, packet, flags, rays, is_occluded):  # type: ignore[no-untyped-def]
        """As `closest_hit_kernel`; is_occluded: (N,) uint8, written completely: 0 or 1."""
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= len(is_occluded):
                return
            for first in range(start, min(start + CHUNK, len(is_occluded)), width):
                lanes = min(width, len(is_occluded) - first)
                anyone = False
                for lane in range(width):
                    packet.valid[lane] = 0
                for lane in range(lanes):
                    anyone |= _load(packet, width, lane, rays, first + lane)
                if anyone:
                    _set_flags(flags, rays, first, lanes)
                    occluded(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    is_open = packet.valid[lane] != 0
                    is_occluded[first + lane] = is_open and hit_distance(packet, width, lane) < 0.0

    return occlude_rays
