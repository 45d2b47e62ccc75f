"""The loop over batches of rays that Embree traces: their closest hits, or whether they hit anything."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import float_kernel, njit
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
from atra.rays.rays_kernels import are_coherent, direction_of, interval_of, origin_of, scale_of

CHUNK = 512
"""Rays a thread takes at a time: whole packets of any width, so that any number of threads makes the same packets."""


@njit(forceinline=True)
def _narrow(vector):  # type: ignore[no-untyped-def]
    return np.float32(vector[0]), np.float32(vector[1]), np.float32(vector[2])


@njit(forceinline=True)
def _scale_of(rays, ray):  # type: ignore[no-untyped-def]
    """(direction; the power of two by which it is multiplied; the inverse of this), all float32."""
    direction = _narrow(direction_of(rays, ray))
    scale, length = scale_of(*direction)
    return direction, np.float32(scale), np.float32(length)


@njit(forceinline=True)
def _load(packet, width, lane, rays, ray):  # type: ignore[no-untyped-def]
    """Put a ray, rounded to float32, into a lane; returns whether it is of any length, and leaves `valid` of the lane
    so.

    Its direction is brought to a largest component of 1 to 2 by a power of two, and its ends to match: no bit of a hit
    then depends on the length of the direction, and what is tiny (`ray_component`) is so for all. Embree would lose
    short directions, and long ones would leave the range of float32. Origins stay as they are: tiny ones lose nothing.
    """
    x, y, z = _narrow(origin_of(rays, ray))
    (u, v, w), scale, length = _scale_of(rays, ray)
    floats = packet.floats
    floats[RAY_ORG_X * width + lane] = x
    floats[RAY_ORG_Y * width + lane] = y
    floats[RAY_ORG_Z * width + lane] = z
    floats[RAY_DIR_X * width + lane] = ray_component(u * scale)
    floats[RAY_DIR_Y * width + lane] = ray_component(v * scale)
    floats[RAY_DIR_Z * width + lane] = ray_component(w * scale)
    tnear, tfar = interval_of(rays, ray)
    near, far = np.float32(tnear) * length, np.float32(tfar) * length
    floats[RAY_TNEAR * width + lane], floats[RAY_TFAR * width + lane] = near, far
    is_open = near < far
    packet.valid[lane] = -1 if is_open else 0
    return is_open


@cache
def embree_kernel(width: int, any_hit: bool) -> Callable[..., None]:
    """The loop over rays for their closest hits, in packets of `width`; any_hit: for whether they hit anything."""

    @float_kernel
    def hit_rays(counter_address, scene, packet, flags, rays, near_by, t, answers):  # type: ignore[no-untyped-def]
        """Trace all rays, chunk by chunk, until the shared counter runs past the last.

        packet: its constant fields (mask, flags, inst_id) are set. flags: (1,) uint32, of the query. rays: `RayBatch`.
        near_by: rays of a packet that start so near each other are tested for coherence; inf, or below 0: flags are
        right as they are. t, answers: (N,), as for `nearest_kernel`.
        """
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= len(answers):
                return
            for first in range(start, min(start + CHUNK, len(answers)), width):
                lanes = min(width, len(answers) - first)
                anyone = False
                for lane in range(width):
                    if not any_hit:
                        set_no_hit(packet, width, lane)
                    packet.valid[lane] = 0
                for lane in range(lanes):
                    anyone |= _load(packet, width, lane, rays, first + lane)
                if anyone:
                    if 0.0 <= near_by < np.inf:
                        others = flags[0] & ~np.uint32(FLAG_COHERENT)
                        flags[0] = others | (FLAG_COHERENT if are_coherent(rays, first, lanes, near_by) else 0)
                    if any_hit:
                        occluded(width, packet.valid, scene, packet)
                    else:
                        intersect(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    distance = hit_distance(packet, width, lane)
                    if any_hit:
                        answers[first + lane] = packet.valid[lane] != 0 and distance < 0.0
                        continue
                    found = hit_prim_id(packet, width, lane)
                    answers[first + lane] = found
                    _, scale, _ = _scale_of(rays, first + lane)
                    t[first + lane] = distance * scale if found != MISS else INFINITY

    return hit_rays
