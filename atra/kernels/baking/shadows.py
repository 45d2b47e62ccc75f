"""Shadows: what stops rays to lights on their way, and what they bring that nothing stops."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import njit

from atra.embree.layout import RAY_TFAR, RAY_TNEAR
from atra.kernels.baking.tables import CARRIED, DIRECTION, LENGTH, ORIGIN
from atra.kernels.caching import float_kernel
from atra.kernels.packets import MISS, hit_distance, hit_prim_id, intersect, occluded, set_no_hit
from atra.kernels.shading.numbers import ONE, ZERO
from atra.kernels.shading.paths import load_rays


@cache
def shine_kernel(width: int, see_through: bool) -> Callable[..., int]:
    """Rays to lights, in packets of `width`; it, and whether triangles may let light on, are constants of the code."""

    @float_kernel
    def shine(batch, count, plane, tables, scene, packet):  # type: ignore[no-untyped-def]
        """What rays that nothing stops carry is added to the results from `plane` on. Returns how many were traced."""
        traced = 0
        for first in range(0, count, width):
            lanes = min(width, count - first)
            rays = 0
            for lane in range(lanes):
                rays += batch.floats[LENGTH, first + lane] > ZERO
            if rays == 0:
                continue
            traced += rays
            load_rays(packet, width, batch.floats, ORIGIN, DIRECTION, first)
            for lane in range(width):
                length = batch.floats[LENGTH, first + lane]
                packet.floats[RAY_TFAR * width + lane] = length
                packet.valid[lane] = -1 if lane < lanes and length > ZERO else 0
            if see_through:
                _filter_light(batch, first, lanes, width, tables, scene, packet)
            else:
                occluded(width, packet.valid, scene, packet)
                for lane in range(lanes):
                    if hit_distance(packet, width, lane) < ZERO:
                        batch.floats[LENGTH, first + lane] = ZERO
            for lane in range(lanes):
                i = first + lane
                if batch.floats[LENGTH, i] > ZERO:
                    for channel in range(3):
                        batch.results[batch.slot[i], plane + channel] += batch.floats[CARRIED + channel, i]
        return traced

    return shine


@njit(inline="always")
def _filter_light(batch, first, lanes, width, tables, scene, packet):  # type: ignore[no-untyped-def]
    """What rays carry, times what each triangle on their way lets on; those that are stopped have no length then."""
    for lane in range(width):
        set_no_hit(packet, width, lane)
    left = 1
    while left > 0:
        intersect(width, packet.valid, scene, packet)
        left = 0
        for lane in range(lanes):
            if packet.valid[lane] == 0:
                continue
            i = first + lane
            packet.valid[lane] = 0
            prim_id = hit_prim_id(packet, width, lane)
            if prim_id == MISS:
                continue
            share = ONE - tables.opacity[prim_id]
            if not share > ZERO:
                batch.floats[LENGTH, i] = ZERO
                continue
            for channel in range(3):
                batch.floats[CARRIED + channel, i] *= share * tables.tint[prim_id, channel]
            near = hit_distance(packet, width, lane) + np.float32(tables.offset)
            if near < batch.floats[LENGTH, i]:
                packet.floats[RAY_TNEAR * width + lane] = near
                packet.floats[RAY_TFAR * width + lane] = batch.floats[LENGTH, i]
                set_no_hit(packet, width, lane)
                packet.valid[lane] = -1
                left += 1
