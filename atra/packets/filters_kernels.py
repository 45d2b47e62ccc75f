"""The Embree filter that takes every hit of a packet's rays."""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import types

from atra.all_hits.taking_kernels import THICKNESS, TRANSMITTANCE, take
from atra.all_hits.target_kernels import target_at, without_doubts
from atra.compiled.intrinsics import address_at, float_at, uint32_at
from atra.compiled.lanes import nonzero_lanes
from atra.compiled.memory import load, store
from atra.compiled.store import callback
from atra.compiled.vectors import splat
from atra.embree.filters_kernels import CONTEXT, HIT, RAY, RAY_COUNT, USER_DATA, VALID, refuse
from atra.embree.layout import HIT_INST_ID, HIT_PRIM_ID, RAY_TFAR, RayQueryContext

_TARGET = RayQueryContext.target_address.offset
_FIRST_PIXEL = RayQueryContext.first_pixel.offset


@cache
def gathering_filter(kind: int, shape_x: int, shape_y: int, cells: str) -> int:
    """Address of the filter for packets of shape_x x shape_y pixels; compiled once per process, cached on disk.

    kind: the reduction's, as for `take`. cells: "none" where the scene is the mesh; "copied" or "instanced" where the
    user data holds an int64 record per triangle or instance, as in `atra.embree.callbacks_kernels`. The
    filter rejects every hit, so that Embree continues, and leaves out undecided hits.
    """
    lanes, nx = shape_x * shape_y, shape_x
    weighted = kind in (THICKNESS, TRANSMITTANCE)
    has_cells, by_instance = cells != "none", cells == "instanced"
    tfar, hit_prim_id, hit_inst_id = RAY_TFAR * lanes * 4, HIT_PRIM_ID * lanes * 4, HIT_INST_ID * lanes * 4

    @callback(types.void(types.int64))
    def gather_hit(arguments):  # type: ignore[no-untyped-def]
        context, valid = address_at(arguments + CONTEXT), address_at(arguments + VALID)
        given = uint32_at(arguments + RAY_COUNT)
        if given == np.uint32(lanes):
            hit = address_at(arguments + HIT)
            prim_id = uint32_at(hit + hit_prim_id)
            pixel = address_at(context + _FIRST_PIXEL)
            if has_cells:
                number = np.int64(uint32_at(hit + hit_inst_id)) if by_instance else np.int64(prim_id)
                record = address_at(address_at(arguments + USER_DATA) + number * 8)
                pixel += record >> 32
                if not by_instance:
                    prim_id = np.uint32(record & 0xFFFFFFFF)
            target = target_at(address_at(context + _TARGET))
            taken = without_doubts(lanes, nx, nonzero_lanes(valid, lanes), prim_id, pixel, target)
            depth = load(address_at(arguments + RAY) + tfar, np.float32(0.0), lanes)
            weight = float_at(target.weights + np.int64(prim_id) * 4) if weighted else np.float32(0.0)
            take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target)
            store(splat(np.int32(0), lanes), valid)
        else:
            refuse(context, valid, given)

    _keep_alive.append(gather_hit)
    return gather_hit.address


# Embree may call filters as long as a scene lives, so compiled code must not be collected.
_keep_alive: list[object] = []
