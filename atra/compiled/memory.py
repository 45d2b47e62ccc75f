"""Memory by address: loads, stores, gathers and prefetches of vectors in Numba code."""

from __future__ import annotations

from functools import partial
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import emitting, pointer_at
from atra.compiled.vectors import HAS_MASK_REGISTERS, VectorType, declared, emit_splat, every_second, unpacked

_I1, _I16, _I32, _I64 = ir.IntType(1), ir.IntType(16), ir.IntType(32), ir.IntType(64)


def _pointer(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type) -> ir.Value:
    return pointer_at(builder, address, kind.as_pointer())


def load_aligned(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type, align: int) -> ir.Value:
    """Emit the load of a value from an address that is a multiple of `align` bytes."""
    value = builder.load(_pointer(builder, address, kind))
    value.align = align
    return value


@intrinsic(prefer_literal=True)
def load(typingctx: Any, address: Any, like: Any, lanes: Any) -> Any:
    """Load `lanes` numbers from an address of any alignment; like: a number of their type."""
    vector = VectorType(types.unliteral(like), lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return load_aligned(builder, values[0], context.get_value_type(vector), vector.element.bitwidth // 8)

    return vector(types.int64, vector.element, lanes), codegen


def _mixed(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, lanes: list[int]) -> ir.Value:
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_I32, len(lanes)), lanes))


@intrinsic(prefer_literal=True)
def points_of(typingctx: Any, base: Any, packed_address: Any, part: Any) -> Any:
    """x, y and nearness of 8 points, as three vectors: rows of 4 float64 at distances, in bytes, from `base`.

    packed_address: of 8 uint64 with a distance in 16 bits each, part 0 ... 3. Faster than gathering columns.
    """
    vector = VectorType(types.float64, 8)
    columns = types.UniTuple(vector, 3)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        base, first = values[0], builder.add(values[1], _I64(2 * part.literal_value))

        def row(k: int) -> ir.Value:
            distance = load_aligned(builder, builder.add(first, _I64(8 * k)), _I16, 2)
            place = builder.add(base, builder.zext(distance, _I64))
            return load_aligned(builder, place, ir.VectorType(ir.DoubleType(), 4), 8)

        mixed = partial(_mixed, builder)
        a, b, c, d = (mixed(row(k), row(k + 4), list(range(8))) for k in range(4))
        even, odd = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
        two, other_two = mixed(a, b, even), mixed(c, d, even)
        x, w = mixed(two, other_two, [0, 1, 8, 9, 4, 5, 12, 13]), mixed(two, other_two, [2, 3, 10, 11, 6, 7, 14, 15])
        y = mixed(mixed(a, b, odd), mixed(c, d, odd), [0, 1, 8, 9, 4, 5, 12, 13])
        return context.make_tuple(builder, columns, [x, y, w])

    return columns(types.int64, types.int64, part), codegen


@intrinsic
def gather_at(typingctx: Any, base: Any, places: Any) -> Any:
    """Gather 8 float32 of an array at address `base`; places: a vector of float64, whole numbers."""

    def emit(builder: ir.IRBuilder, base: ir.Value, places: ir.Value) -> ir.Value:
        integers = ir.VectorType(_I64, 8)
        distances = builder.shl(builder.fptosi(places, integers), ir.Constant(integers, [2] * 8))
        addresses, kind = builder.add(distances, emit_splat(builder, base, 8)), ir.VectorType(ir.FloatType(), 8)
        pointers = pointer_at(builder, addresses, ir.VectorType(kind.element.as_pointer(), 8))
        every_lane, nothing = ir.Constant(ir.VectorType(_I1, 8), [1] * 8), ir.Constant(kind, ir.Undefined)
        function = ir.FunctionType(kind, [pointers.type, _I32, every_lane.type, kind])
        gather = declared(builder, "llvm.masked.gather.v8f32.v8p0", function)
        return builder.call(gather, [pointers, _I32(4), every_lane, nothing])

    return VectorType(types.float32, 8)(types.int64, places), emitting(emit)


@intrinsic
def store_points(typingctx: Any, x: Any, y: Any, w: Any, address: Any) -> Any:
    """Store x, y, w of each lane of three vectors of 8, and after them x and y as float32, lane after lane."""

    def emit(builder: ir.IRBuilder, x: ir.Value, y: ir.Value, w: ir.Value, address: ir.Value) -> None:
        mixed = partial(_mixed, builder)
        single = ir.VectorType(ir.FloatType(), 8)
        in_turn = [8 * part + k for k in range(8) for part in (0, 1)]
        pairs = builder.bitcast(mixed(builder.fptrunc(x, single), builder.fptrunc(y, single), in_turn), x.type)
        for odd in (0, 1):
            lanes = [8 * part + k + odd for k in range(0, 8, 2) for part in (0, 1)]
            places, others = mixed(x, y, lanes), mixed(w, pairs, lanes)
            for k in range(0, 8, 2):
                point = mixed(places, others, [k, k + 1, 8 + k, 9 + k])
                builder.store(
                    point, _pointer(builder, builder.add(address, _I64(32 * (k + odd))), point.type)
                ).align = 8

    return types.void(x, y, w, types.int64), emitting(emit)


@intrinsic(prefer_literal=True)
def places_of(typingctx: Any, base: Any, packed_address: Any, part: Any) -> Any:
    """x and y of 8 points of `store_points`, as two vectors of float32; packed_address, part: as for `points_of`."""
    vector = VectorType(types.float32, 8)
    both = types.UniTuple(vector, 2)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        pairs = ir.Constant(ir.VectorType(ir.DoubleType(), 8), ir.Undefined)
        for k in range(8):
            distance = load_aligned(builder, builder.add(values[1], _I64(8 * k + 2 * part.literal_value)), _I16, 2)
            place = builder.add(builder.add(values[0], _I64(24)), builder.zext(distance, _I64))
            pairs = builder.insert_element(pairs, load_aligned(builder, place, ir.DoubleType(), 8), _I32(k))
        mixed = builder.bitcast(pairs, ir.VectorType(ir.FloatType(), 16))
        return context.make_tuple(builder, both, every_second(builder, mixed, 16))

    return both(types.int64, types.int64, part), codegen


@intrinsic
def store(typingctx: Any, vector: Any, address: Any) -> Any:
    """Store all lanes at an address, any alignment."""

    def emit(builder: ir.IRBuilder, value: ir.Value, address: ir.Value) -> None:
        builder.store(value, _pointer(builder, address, value.type)).align = vector.element.bitwidth // 8

    return types.void(vector, types.int64), emitting(emit)


@intrinsic
def stream(typingctx: Any, vector: Any, address: Any) -> Any:
    """Store all lanes past the caches, at an address that is a multiple of the vector's bytes."""

    def emit(builder: ir.IRBuilder, value: ir.Value, address: ir.Value) -> None:
        stored = builder.store(value, _pointer(builder, address, value.type))
        stored.align = vector.lanes * vector.element.bitwidth // 8
        stored.set_metadata("nontemporal", builder.module.add_metadata([_I32(1)]))

    return types.void(vector, types.int64), emitting(emit)


class _VolatileStore(ir.instructions.StoreInstr):
    """A store that LLVM does not make a masked one of; llvmlite has no word for it."""

    def descr(self, buf: list[str]) -> None:
        super().descr(buf)
        buf[-1] = buf[-1].replace("store ", "store volatile ", 1)


def store_lanes(builder: ir.IRBuilder, bits: ir.Value, value: ir.Value, address: ir.Value) -> None:
    """Emit the store of the lanes whose bit is set, numbers of 4 bytes, at an address of any alignment."""
    pointer = _pointer(builder, address, value.type)
    if HAS_MASK_REGISTERS:
        kind = ir.FunctionType(ir.VoidType(), [value.type, pointer.type, _I32, bits.type])
        suffix = f"v{value.type.count}{'f32' if isinstance(value.type.element, ir.FloatType) else 'i32'}.p0"
        builder.call(declared(builder, f"llvm.masked.store.{suffix}", kind), [value, pointer, _I32(4), bits])
    else:
        old = load_aligned(builder, address, value.type, 4)
        stored = builder.store(builder.select(bits, value, old), pointer)
        stored.align = 4
        stored.__class__ = _VolatileStore


@intrinsic
def store_where(typingctx: Any, mask: Any, vector: Any, address: Any) -> Any:
    """Store the lanes of a mask, numbers of 4 bytes, at an address of any alignment."""

    def emit(builder: ir.IRBuilder, mask: ir.Value, value: ir.Value, address: ir.Value) -> None:
        store_lanes(builder, unpacked(builder, mask), value, address)

    return types.void(mask, vector, types.int64), emitting(emit)


def _numbers_at(kind: types.Type) -> Any:
    @intrinsic
    def numbers(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            return pointer_at(builder, values[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(types.int64), codegen

    return numbers


doubles_at, floats_at = _numbers_at(types.float64), _numbers_at(types.float32)
integers_at, identities_at = _numbers_at(types.int64), _numbers_at(types.uint32)
"""Numbers from an address on, indexed like an array but without Numba's reference counting."""


@intrinsic
def prefetch(typingctx: Any, address: Any) -> Any:
    """Prefetch the cache line at an address."""

    def emit(builder: ir.IRBuilder, address: ir.Value) -> None:
        pointer = _pointer(builder, address, ir.IntType(8))
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, _I32, _I32, _I32])
        builder.call(declared(builder, "llvm.prefetch.p0", kind), [pointer, _I32(0), _I32(3), _I32(1)])

    return types.void(types.int64), emitting(emit)
