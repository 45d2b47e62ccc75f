"""Sort keys of hits: one integer, depth above prim_id, so layers sort by their keys."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import pointer_at
from atra.compiled.vectors import VectorType
from atra.prim_ids import MISS

_I32, _I64 = ir.IntType(32), ir.IntType(64)

_NOTHING = 0x7F800000 << 32 | int(MISS)
"""The key of no hit: infinitely far."""


def _places(places: list[int]) -> ir.Constant:
    return ir.Constant(ir.VectorType(_I32, len(places)), places)


def _keys(builder: ir.IRBuilder, depths: ir.Value, prim_ids: ir.Value) -> ir.Value:
    lanes = prim_ids.type.count
    order = _places([half * lanes + lane for lane in range(lanes) for half in (0, 1)])
    high = builder.bitcast(depths, prim_ids.type)
    return builder.bitcast(builder.shuffle_vector(prim_ids, high, order), ir.VectorType(_I64, lanes))


@intrinsic
def keys_of(typingctx: Any, depth: Any, prim_ids: Any) -> Any:
    """Keys of non-negative float32 depths and uint32 prim_ids."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return _keys(builder, *values)

    return VectorType(types.uint64, depth.lanes)(depth, prim_ids), codegen


def _half(place: int, kind: types.Type) -> Any:
    @intrinsic
    def half(typingctx: Any, keys: Any) -> Any:
        lanes, vector = keys.lanes, VectorType(kind, keys.lanes)

        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            words = builder.bitcast(values[0], ir.VectorType(_I32, 2 * lanes))
            found = builder.shuffle_vector(words, words, _places(list(range(place, 2 * lanes, 2))))
            return builder.bitcast(found, context.get_value_type(vector))

        return vector(keys), codegen

    return half


prim_ids_of, depths_of = _half(0, types.uint32), _half(1, types.float32)
"""prim_ids_of(keys) and depths_of(keys): the inverse of `keys_of`."""


def _pointers(builder: ir.IRBuilder, first: ir.Value, second: ir.Value, lanes: int) -> list[ir.Value]:
    kind = ir.VectorType(_I64, lanes // 2).as_pointer()
    return [pointer_at(builder, first, kind), pointer_at(builder, second, kind)]


@intrinsic(prefer_literal=True)
def load_keys(typingctx: Any, first: Any, second: Any, lanes: Any) -> Any:
    """Load keys whose halves lie at two addresses."""
    count = lanes.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        parts = [builder.load(pointer) for pointer in _pointers(builder, values[0], values[1], count)]
        for part in parts:
            part.align = 4
        return builder.shuffle_vector(*parts, _places(list(range(count))))

    return VectorType(types.uint64, count)(types.int64, types.int64, lanes), codegen


def _store(builder: ir.IRBuilder, keys: ir.Value, first: ir.Value, second: ir.Value) -> None:
    lanes = keys.type.count
    for half, pointer in enumerate(_pointers(builder, first, second, lanes)):
        places = _places(list(range(half * lanes // 2, (half + 1) * lanes // 2)))
        builder.store(builder.shuffle_vector(keys, keys, places), pointer).align = 4


@intrinsic
def store_keys(typingctx: Any, keys: Any, first: Any, second: Any) -> Any:
    """The inverse of `load_keys`."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        _store(builder, *values)
        return context.get_dummy_value()

    return types.void(keys, types.int64, types.int64), codegen


def _exchanges(count: int) -> Iterator[tuple[int, int]]:
    """Pairs of places; ordering each pair in turn sorts `count` keys, a power of two.

    Source: K. E. Batcher, "Sorting networks and their applications", 1968: odd-even merging.
    """
    sizes = [1 << bit for bit in range(count.bit_length() - 1)]
    for size in sizes:
        for apart in reversed(sizes[: sizes.index(size) + 1]):
            for start in range(apart % size, count - apart, 2 * apart):
                for low in range(start, start + apart):
                    if low // (2 * size) == (low + apart) // (2 * size):
                        yield low, low + apart


@intrinsic(prefer_literal=True)
def sort_few(typingctx: Any, depths: Any, prim_ids: Any, plane: Any, counts: Any, count: Any, kept: Any) -> Any:
    """Sort the layers of as many pixels as `counts` has lanes, and store the keys of the first `kept` in their place.

    depths, prim_ids: addresses in the first layer. plane: bytes to the next layer. count: layers to read, a power of
    two and at least the most hits of a pixel.
    """
    lanes, layers, wanted = counts.lanes, count.literal_value, kept.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        kind = ir.VectorType(_I32, lanes)
        places = [[builder.add(first, builder.mul(values[2], _I64(layer))) for first in values[:2]]
                  for layer in range(layers)]  # fmt: skip
        keys = []
        for layer, pair in enumerate(places):
            loaded = [builder.load(pointer_at(builder, place, kind.as_pointer())) for place in pair]
            for part in loaded:
                part.align = 4
            has_hit = builder.icmp_unsigned("<", ir.Constant(kind, [layer] * lanes), values[3])
            found = _keys(builder, *loaded)
            keys.append(builder.select(has_hit, found, ir.Constant(found.type, [_NOTHING] * lanes)))
        for a, b in _exchanges(layers):
            in_order = builder.icmp_unsigned("<", keys[a], keys[b])
            keys[a], keys[b] = (builder.select(in_order, *pair) for pair in ((keys[a], keys[b]), (keys[b], keys[a])))
        for one, pair in zip(keys[:wanted], places, strict=False):
            _store(builder, one, *pair)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, counts, count, kept), codegen
