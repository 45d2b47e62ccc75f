"""Filters: functions that Embree calls for every triangle that rays of a packet hit. Here: what all filters share, and
the filter that keeps the nearest hit of every cell (LLVM IR)."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from atra.compiled.intrinsics import pointer_at
from atra.compiled.lanes import emit_load_rows, emit_store_rows
from atra.compiled.memory import load_aligned, store
from atra.compiled.store import njit
from atra.compiled.vectors import emit_splat, splat
from atra.embree import layout
from atra.embree.layout import FilterArguments, RayQueryContext

_I32, _I64, _F32 = ir.IntType(32), ir.IntType(64), ir.FloatType()

VALID, USER_DATA, CONTEXT = (
    FilterArguments.valid.offset,
    FilterArguments.user_data.offset,
    FilterArguments.context.offset,
)
RAY, HIT, RAY_COUNT = FilterArguments.ray.offset, FilterArguments.hit.offset, FilterArguments.ray_count.offset
_WRONG_WIDTH = RayQueryContext.wrong_width.offset


@intrinsic(prefer_literal=True)
def keep_nearest(typingctx: Any, arguments_address: Any, shape_x: Any, shape_y: Any, instanced: Any) -> Any:
    """The filter: keep the hits of one triangle by K = shape_x * shape_y rays where they are nearer than the cell's.

    Lane k is pixel (k % shape_x, k // shape_x) of the packet. The user data is one int64 record per triangle or, if
    `instanced`, per instance. Its high half is the distance in pixels from the reference cell to the cell that was hit.
    Its low half is the triangle's prim_id in the mesh; with instances the hit itself has it.
    Every hit is then rejected, so that Embree goes on to the next triangle.
    """
    if not all(isinstance(constant, types.Literal) for constant in (shape_x, shape_y, instanced)):
        raise TypingError("the packet's shape and `instanced` must be known when the filter is compiled")
    nx, ny, by_instance = shape_x.literal_value, shape_y.literal_value, instanced.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        _emit_keep_nearest(builder, arguments[0], nx, ny, by_instance)
        return context.get_dummy_value()

    return types.void(types.int64, shape_x, shape_y, instanced), codegen


def _emit_keep_nearest(builder: ir.IRBuilder, arguments: ir.Value, nx: int, ny: int, by_instance: bool) -> None:
    width = nx * ny

    def load(kind: ir.Type, address: ir.Value, align: int = 4) -> ir.Value:
        return load_aligned(builder, address, kind, align)

    def store(value: ir.Value, address: ir.Value, align: int = 4) -> None:
        builder.store(value, pointer_at(builder, address, value.type.as_pointer())).align = align

    def at(address: ir.Value, offset: int) -> ir.Value:
        return builder.add(address, _I64(offset))

    def vector(kind: ir.Type) -> ir.VectorType:
        return ir.VectorType(kind, width)

    valid_address = load(_I64, at(arguments, FilterArguments.valid.offset), 8)
    context = load(_I64, at(arguments, FilterArguments.context.offset), 8)
    lane_count = load(_I32, at(arguments, FilterArguments.ray_count.offset))
    with builder.if_else(builder.icmp_unsigned("==", lane_count, _I32(width)), likely=True) as (expected, surprise):
        with expected:
            records = load(_I64, at(arguments, FilterArguments.user_data.offset), 8)
            ray = load(_I64, at(arguments, FilterArguments.ray.offset), 8)
            hit = load(_I64, at(arguments, FilterArguments.hit.offset), 8)
            valid = load(vector(_I32), valid_address)
            depth = load(vector(_F32), at(ray, layout.RAY_TFAR * width * 4))
            # One triangle of one instance per call: every lane, active or not, carries the same prim_id and inst_id.
            hit_prim_id = load(_I32, at(hit, layout.HIT_PRIM_ID * width * 4))
            record_id = load(_I32, at(hit, layout.HIT_INST_ID * width * 4)) if by_instance else hit_prim_id
            record = load(_I64, builder.add(records, builder.shl(builder.zext(record_id, _I64), _I64(3))), 8)
            prim_id = hit_prim_id if by_instance else builder.trunc(record, _I32)
            cell_bytes = builder.shl(builder.ashr(record, _I64(32)), _I64(2))
            row_bytes = load(_I64, at(context, RayQueryContext.row_bytes.offset), 8)
            depth_base = builder.add(load(_I64, at(context, RayQueryContext.depth_address.offset), 8), cell_bytes)
            old_depth = emit_load_rows(builder, _F32, depth_base, row_bytes, nx, ny)
            nearer = builder.and_(
                builder.icmp_signed("!=", valid, ir.Constant(vector(_I32), [0] * width)),
                builder.fcmp_ordered("<", depth, old_depth),
            )
            any_nearer = builder.icmp_unsigned(
                "!=", builder.bitcast(nearer, ir.IntType(width)), ir.Constant(ir.IntType(width), 0)
            )
            with builder.if_then(any_nearer):
                prim_base = builder.add(load(_I64, at(context, RayQueryContext.prim_id_address.offset), 8), cell_bytes)
                old_prim_id = emit_load_rows(builder, _I32, prim_base, row_bytes, nx, ny)
                kept_depth = builder.select(nearer, depth, old_depth)
                kept_prim_id = builder.select(nearer, emit_splat(builder, prim_id, width), old_prim_id)
                emit_store_rows(builder, kept_depth, depth_base, row_bytes, nx)
                emit_store_rows(builder, kept_prim_id, prim_base, row_bytes, nx)
            store(ir.Constant(vector(_I32), [0] * width), valid_address)
        with surprise:
            store(builder.zext(lane_count, _I64), at(context, RayQueryContext.wrong_width.offset), 8)
            store(_I32(0), valid_address)


@njit
def refuse(context, valid, given):  # type: ignore[no-untyped-def]
    """Reject the hits of a packet of another width than was sent; `Workspace.wrong_width` then tells `given`."""
    store(splat(np.int64(given), 1), context + _WRONG_WIDTH)
    for lane in range(np.int64(given)):
        store(splat(np.int32(0), 1), valid + lane * 4)
