"""Kernels of shadow rays: what blocks them, and the light that arrives."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.store import float_kernel, njit
from atra.embree.layout import RAY_TFAR, RAY_TNEAR
from atra.embree.packets_kernels import (
    MISS,
    SMALLEST_COMPONENT,
    hit_distance,
    hit_prim_id,
    intersect,
    occluded,
    set_no_hit,
)
from atra.light.lightmaps.gather.tables_kernels import CARRIED, DIRECTION, LENGTH, ORIGIN
from atra.light.lightmaps.paint_kernels import opacity_met
from atra.light.numbers_kernels import ONE, ZERO, vector
from atra.light.pictures.path_kernels import load_rays

_LESS, _MORE = np.float32(1 - 1e-6), np.float32(1 + 1e-6)
"""Margins for rounding on distances to a box."""


@cache
def shine_kernel(width: int, see_through: bool) -> Callable[..., int]:
    """Rays to lights in packets of `width`; both arguments are constants in the compiled code. see_through: there are
    panes."""

    @float_kernel
    def shine(batch, count, plane, tables, paint, scenes, packet):  # type: ignore[no-untyped-def]
        """Add what unblocked rays carry to the results from `plane` on. Returns the number of rays traced.

        scenes: addresses of opaque faces and of panes.
        """
        opaque, panes = scenes
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
            occluded(width, packet.valid, opaque, packet)
            for lane in range(lanes):
                if hit_distance(packet, width, lane) < ZERO:
                    batch.floats[LENGTH, first + lane] = ZERO
                    packet.valid[lane] = 0
            if see_through:
                _filter_light(batch, first, lanes, width, tables, paint, panes, packet)
            for lane in range(lanes):
                i = first + lane
                if batch.floats[LENGTH, i] > ZERO:
                    for channel in range(3):
                        batch.results[batch.slot[i], plane + channel] += batch.floats[CARRIED + channel, i]
        return traced

    return shine


@njit(error_model="numpy")
def _may_meet(box, floats, i):  # type: ignore[no-untyped-def]
    """Whether a ray meets the box of all panes; cheaper than asking Embree."""
    near, far = ZERO, floats[LENGTH, i]
    for axis in range(3):
        way = floats[DIRECTION + axis, i]
        low, high = box[0, axis] - floats[ORIGIN + axis, i], box[1, axis] - floats[ORIGIN + axis, i]
        if abs(way) < SMALLEST_COMPONENT:
            if low > ZERO or high < ZERO:
                return False
        else:
            inverse = ONE / way
            first, second = low * inverse, high * inverse
            near, far = max(near, min(first, second)), min(far, max(first, second))
    return near * _LESS <= far * _MORE


@njit(forceinline=True)
def _filter_light(batch, first, lanes, width, tables, paint, panes, packet):  # type: ignore[no-untyped-def]
    """Multiply the carried light of valid rays by what each pane on their way lets pass."""
    left = 0
    for lane in range(width):
        set_no_hit(packet, width, lane)
        if packet.valid[lane] != 0:
            if _may_meet(tables.box_of_panes, batch.floats, first + lane):
                left += 1
            else:
                packet.valid[lane] = 0
    while left > 0:
        intersect(width, packet.valid, panes, packet)
        left = 0
        for lane in range(lanes):
            if packet.valid[lane] == 0:
                continue
            i = first + lane
            packet.valid[lane] = 0
            prim_id = hit_prim_id(packet, width, lane)
            if prim_id == MISS:
                continue
            origin, direction = vector(batch.floats, ORIGIN, i), vector(batch.floats, DIRECTION, i)
            share = ONE - opacity_met(tables, paint, prim_id, origin, direction)
            for channel in range(3):
                batch.floats[CARRIED + channel, i] *= share * tables.tint[prim_id, channel]
            near = hit_distance(packet, width, lane) + np.float32(tables.offset)
            if near < batch.floats[LENGTH, i]:
                packet.floats[RAY_TNEAR * width + lane] = near
                packet.floats[RAY_TFAR * width + lane] = batch.floats[LENGTH, i]
                set_no_hit(packet, width, lane)
                packet.valid[lane] = -1
                left += 1
