"""Compiled C functions that Embree calls: the filter that keeps the nearest hits, and the memory monitor."""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import types

from atra.compiled.intrinsics import address_at, fetch_add, uint32_at
from atra.compiled.lanes import load_rows, nonzero_lanes, store_rows
from atra.compiled.memory import load, store
from atra.compiled.store import callback
from atra.compiled.vectors import bits_of, splat, where
from atra.embree.filters_kernels import CONTEXT, HIT, RAY, RAY_COUNT, USER_DATA, VALID, refuse
from atra.embree.layout import HIT_INST_ID, HIT_PRIM_ID, RAY_TFAR, RayQueryContext

_DEPTH, _PRIM_ID = RayQueryContext.depth_address.offset, RayQueryContext.prim_id_address.offset
_ROW_BYTES = RayQueryContext.row_bytes.offset


@cache
def nearest_hit_filter(shape_x: int, shape_y: int, instanced: bool = False) -> int:
    """Address of the filter for packets of shape_x x shape_y pixels that keeps hits nearer than their cell's.

    Lane k is pixel (k % shape_x, k // shape_x) of the packet. The user data is one int64 record per triangle or, if
    `instanced`, per instance. Its high half is the distance in pixels from the reference cell to the cell that was hit.
    Its low half is the triangle's prim_id in the mesh; with instances the hit itself has it.
    Every hit is then rejected, so that Embree goes on to the next triangle.
    """
    lanes, nx = shape_x * shape_y, shape_x
    tfar, hit_prim_id, hit_inst_id = RAY_TFAR * lanes * 4, HIT_PRIM_ID * lanes * 4, HIT_INST_ID * lanes * 4

    @callback(types.void(types.int64))
    def keep_nearest(arguments):  # type: ignore[no-untyped-def]
        context, valid = address_at(arguments + CONTEXT), address_at(arguments + VALID)
        given = uint32_at(arguments + RAY_COUNT)
        if given == np.uint32(lanes):
            # One triangle of one instance per call: every lane, active or not, carries the same prim_id and inst_id.
            hit = address_at(arguments + HIT)
            prim_id = uint32_at(hit + hit_prim_id)
            number = uint32_at(hit + hit_inst_id) if instanced else prim_id
            record = address_at(address_at(arguments + USER_DATA) + np.int64(number) * 8)
            row, cell = address_at(context + _ROW_BYTES), (record >> 32) * 4
            depth = load(address_at(arguments + RAY) + tfar, np.float32(0.0), lanes)
            depths = address_at(context + _DEPTH) + cell
            old_depth = load_rows(depths, row, np.float32(0.0), lanes, nx)
            is_nearer = nonzero_lanes(valid, lanes) & (old_depth > depth)
            if bits_of(is_nearer) != 0:
                own = prim_id if instanced else np.uint32(record & 0xFFFFFFFF)
                prim_ids = address_at(context + _PRIM_ID) + cell
                old_prim_id = load_rows(prim_ids, row, np.uint32(0), lanes, nx)
                store_rows(where(is_nearer, depth, old_depth), depths, row, nx)
                store_rows(where(is_nearer, splat(own, lanes), old_prim_id), prim_ids, row, nx)
            store(splat(np.int32(0), lanes), valid)
        else:
            refuse(context, valid, given)

    _keep_alive.append(keep_nearest)
    return keep_nearest.address


@cache
def memory_monitor() -> int:
    """Address of the memory monitor, which adds Embree's allocations to the int64 it is registered with."""

    @callback(types.boolean(types.int64, types.int64, types.boolean))
    def count_bytes(counter_address, byte_count, after):  # type: ignore[no-untyped-def]
        fetch_add(counter_address, byte_count)
        return True

    _keep_alive.append(count_bytes)
    return count_bytes.address


# Embree may call these as long as a scene lives; compiled code must never be collected.
_keep_alive: list[object] = []
