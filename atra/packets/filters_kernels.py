"""The Embree filter: it takes every hit of a packet's rays, or keeps those nearer than what their pixels show."""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import types

from atra.all_hits.taking_kernels import THICKNESS, TRANSMITTANCE, take
from atra.all_hits.target_kernels import target_at, without_undecided
from atra.compiled.intrinsics import address_at, float_at, uint32_at
from atra.compiled.lanes import load_rows, nonzero_lanes, store_rows
from atra.compiled.memory import load, store
from atra.compiled.store import callback
from atra.compiled.vectors import bits_of, splat, where
from atra.embree.filters_kernels import CONTEXT, HIT, RAY, RAY_COUNT, USER_DATA, VALID, keep_alive, refuse
from atra.embree.layout import HIT_INST_ID, HIT_PRIM_ID, RAY_TFAR, RayQueryContext

NEAREST_HIT = -1
"""In place of a reduction: of each pixel the nearest hit is kept."""

_FIRST_PIXEL, _TARGET = RayQueryContext.first_pixel.offset, RayQueryContext.target_address.offset
_DEPTH, _PRIM_ID = RayQueryContext.depth_address.offset, RayQueryContext.prim_id_address.offset
_ROW_BYTES = RayQueryContext.row_bytes.offset


@cache
def hit_filter(kind: int, shape_x: int, shape_y: int, cells: str) -> int:
    """Address of the filter for packets of shape_x x shape_y pixels; compiled once per process, cached on disk.

    kind: NEAREST_HIT or a reduction's, as for `take`. cells: "none" where the scene is the mesh; "copied" or
    "instanced" where the user data holds an int64 record per triangle or instance. The record's high half is the
    distance in pixels from the reference cell to the cell that was hit, its low half the triangle's prim_id in the
    mesh; with instances the hit itself has it. Lane k is pixel (k % shape_x, k // shape_x) of the packet. The filter
    rejects every hit, so that Embree goes on to the next triangle.
    """
    lanes, nx, is_nearest = shape_x * shape_y, shape_x, kind == NEAREST_HIT
    weighted = kind in (THICKNESS, TRANSMITTANCE)
    has_cells, by_instance = cells != "none", cells == "instanced"
    tfar, hit_prim_id, hit_inst_id = RAY_TFAR * lanes * 4, HIT_PRIM_ID * lanes * 4, HIT_INST_ID * lanes * 4

    @callback(types.void(types.int64))
    def take_hits(arguments):  # type: ignore[no-untyped-def]
        context, valid = address_at(arguments + CONTEXT), address_at(arguments + VALID)
        given = uint32_at(arguments + RAY_COUNT)
        if given == np.uint32(lanes):
            # One triangle of one instance per call: every lane, active or not, carries the same prim_id and inst_id.
            hit = address_at(arguments + HIT)
            prim_id, pixels = uint32_at(hit + hit_prim_id), np.int64(0)
            if has_cells:
                number = np.int64(uint32_at(hit + hit_inst_id)) if by_instance else np.int64(prim_id)
                record = address_at(address_at(arguments + USER_DATA) + number * 8)
                pixels = record >> 32
                if not by_instance:
                    prim_id = np.uint32(record & 0xFFFFFFFF)
            depth = load(address_at(arguments + RAY) + tfar, np.float32(0.0), lanes)
            if is_nearest:
                depths, row = address_at(context + _DEPTH) + pixels * 4, address_at(context + _ROW_BYTES)
                old_depth = load_rows(depths, row, np.float32(0.0), lanes, nx)
                is_nearer = nonzero_lanes(valid, lanes) & (old_depth > depth)
                if bits_of(is_nearer) != 0:
                    prim_ids = address_at(context + _PRIM_ID) + pixels * 4
                    old_prim_id = load_rows(prim_ids, row, np.uint32(0), lanes, nx)
                    store_rows(where(is_nearer, depth, old_depth), depths, row, nx)
                    store_rows(where(is_nearer, splat(prim_id, lanes), old_prim_id), prim_ids, row, nx)
            else:
                target, pixel = target_at(address_at(context + _TARGET)), address_at(context + _FIRST_PIXEL) + pixels
                taken = without_undecided(lanes, nx, nonzero_lanes(valid, lanes), prim_id, pixel, target)
                weight = float_at(target.weights + np.int64(prim_id) * 4) if weighted else np.float32(0.0)
                take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target)
            store(splat(np.int32(0), lanes), valid)
        else:
            refuse(context, valid, given)

    return keep_alive(take_hits)
