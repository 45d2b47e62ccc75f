"""Keys: a hit as one whole number, its depth above its prim_id; so layers are in the order of their keys."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.kernels.intrinsics import pointer_at
from atra.kernels.raster.vectors import Vector

_I32, _I64 = ir.IntType(32), ir.IntType(64)


def _places(places: list[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(_I32, len(places)), places)


@intrinsic
def keys_of(typingctx: Any, depth: Any, prim_ids: Any) -> Any:
    """Of depths, float32 that are not negative, and as many uint32."""
    lanes = depth.lanes

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        high = builder.bitcast(values[0], ir.VectorType(_I32, lanes))
        order = _places([half * lanes + lane for lane in range(lanes) for half in (0, 1)])
        return builder.bitcast(builder.shuffle_vector(values[1], high, order), ir.VectorType(_I64, lanes))

    return Vector(types.uint64, lanes)(depth, prim_ids), codegen


def _half(place: int, kind: types.Type) -> Any:
    @intrinsic
    def half(typingctx: Any, keys: Any) -> Any:
        lanes, vector = keys.lanes, Vector(kind, keys.lanes)

        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            words = builder.bitcast(values[0], ir.VectorType(_I32, 2 * lanes))
            found = builder.shuffle_vector(words, words, _places(list(range(place, 2 * lanes, 2))))
            return builder.bitcast(found, context.get_value_type(vector))

        return vector(keys), codegen

    return half


prim_ids_of, depths_of = _half(0, types.uint32), _half(1, types.float32)
"""prim_ids_of(keys), depths_of(keys): what `keys_of` made them of."""


def _pointers(builder: ir.IRBuilder, first: ir.Value, second: ir.Value, lanes: int) -> list[ir.Value]:
    kind = ir.VectorType(_I64, lanes // 2).as_pointer()
    return [pointer_at(builder, first, kind), pointer_at(builder, second, kind)]


@intrinsic(prefer_literal=True)
def load_keys(typingctx: Any, first: Any, second: Any, lanes: Any) -> Any:
    """Keys, the first half of them at one address and the others at another."""
    count = lanes.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        parts = [builder.load(pointer) for pointer in _pointers(builder, values[0], values[1], count)]
        for part in parts:
            part.align = 4
        return builder.shuffle_vector(*parts, _places(list(range(count))))

    return Vector(types.uint64, count)(types.int64, types.int64, lanes), codegen


@intrinsic
def store_keys(typingctx: Any, keys: Any, first: Any, second: Any) -> Any:
    """The reverse of `load_keys`."""
    lanes = keys.lanes

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        for half, pointer in enumerate(_pointers(builder, values[1], values[2], lanes)):
            places = _places(list(range(half * lanes // 2, (half + 1) * lanes // 2)))
            builder.store(builder.shuffle_vector(values[0], values[0], places), pointer).align = 4
        return context.get_dummy_value()

    return types.void(keys, types.int64, types.int64), codegen
