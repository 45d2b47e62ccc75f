"""Memory by its address: vectors and single numbers of Numba code read and written, gathered, and asked for ahead."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import pointer_at
from atra.compiled.vectors import HAS_MASK_REGISTERS, Vector, declared, splat, unpacked

_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


def _pointer(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type) -> ir.Value:
    return pointer_at(builder, address, kind.as_pointer())


@intrinsic(prefer_literal=True)
def load(typingctx: Any, address: Any, like: Any, lanes: Any) -> Any:
    """The numbers at an address, any alignment; like: a number of their type."""
    vector = Vector(types.unliteral(like), lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        loaded = builder.load(_pointer(builder, values[0], context.get_value_type(vector)))
        loaded.align = vector.element.bitwidth // 8
        return loaded

    return vector(types.int64, vector.element, lanes), codegen


def _gathered(builder: ir.IRBuilder, addresses: ir.Value, kind: ir.VectorType, name: str, size: int) -> ir.Value:
    pointers = pointer_at(builder, addresses, ir.VectorType(kind.element.as_pointer(), kind.count))
    all_ = ir.Constant(ir.VectorType(_I1, kind.count), [1] * kind.count)
    gather = declared(
        builder,
        f"llvm.masked.gather.{name}.v{kind.count}p0",
        ir.FunctionType(kind, [pointers.type, _I32, all_.type, kind]),
    )
    return builder.call(gather, [pointers, _I32(size), all_, ir.Constant(kind, ir.Undefined)])


@intrinsic(prefer_literal=True)
def gather(typingctx: Any, base: Any, packed_address: Any, part: Any) -> Any:
    """8 float64, each so many bytes from an address as the 16 bits of one part, 0 ... 3, of 8 uint64 say."""
    vector, number = Vector(types.float64, 8), part.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        integers = ir.VectorType(_I64, 8)
        packed = builder.load(_pointer(builder, values[1], integers))
        packed.align = 8
        shifted = builder.lshr(packed, ir.Constant(integers, [16 * number] * 8))
        distances = builder.and_(shifted, ir.Constant(integers, [0xFFFF] * 8))
        addresses = builder.add(distances, splat(builder, values[0], 8))
        return _gathered(builder, addresses, context.get_value_type(vector), "v8f64", 8)

    return vector(types.int64, types.int64, part), codegen


@intrinsic
def gather_at(typingctx: Any, base: Any, places: Any) -> Any:
    """8 float32 from an address on, at the places that a vector of whole numbers, in float64, says."""
    vector = Vector(types.float32, 8)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        distances = builder.shl(
            builder.fptosi(values[1], ir.VectorType(_I64, 8)), ir.Constant(ir.VectorType(_I64, 8), [2] * 8)
        )
        addresses = builder.add(distances, splat(builder, values[0], 8))
        return _gathered(builder, addresses, context.get_value_type(vector), "v8f32", 4)

    return vector(types.int64, places), codegen


@intrinsic
def columns_of(typingctx: Any, base: Any, numbers_address: Any) -> Any:
    """8 vectors, the columns of those rows of 8 float64 from an address on whose numbers, 8 uint32, stand at another.

    Each row is read at once and all are then transposed, which takes less time than to gather two columns; a row that
    all share is only spread.
    """
    vector = Vector(types.float64, 8)
    columns = types.UniTuple(vector, 8)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        kind = context.get_value_type(vector)
        numbers = builder.load(_pointer(builder, values[1], ir.VectorType(_I32, 8)))
        numbers.align = 4

        def row(k: int) -> ir.Value:
            number = builder.zext(builder.extract_element(numbers, _I32(k)), _I64)
            place = builder.add(values[0], builder.shl(number, _I64(6)))
            loaded = builder.load(_pointer(builder, place, kind))
            loaded.align = 8
            return loaded

        same = builder.icmp_unsigned("==", numbers, splat(builder, builder.extract_element(numbers, _I32(0)), 8))
        all_same = builder.icmp_unsigned("==", builder.bitcast(same, ir.IntType(8)), ir.IntType(8)(255))
        with builder.if_else(all_same) as (shared, own):
            with shared:
                one = row(0)
                spread = [splat(builder, builder.extract_element(one, _I32(k)), 8) for k in range(8)]
                spread_end = builder.block
            with own:
                turned = _transposed(builder, [row(k) for k in range(8)])
                turned_end = builder.block
        found = []
        for ends in zip(spread, turned, strict=True):
            phi = builder.phi(kind)
            for value, end in zip(ends, (spread_end, turned_end), strict=True):
                phi.add_incoming(value, end)
            found.append(phi)
        return context.make_tuple(builder, columns, found)

    return columns(types.int64, types.int64), codegen


def _transposed(builder: ir.IRBuilder, rows: list[ir.Value]) -> list[ir.Value]:
    """8 vectors of 8: ever larger blocks of rows and columns change places."""
    for step in (1, 2, 4):
        first = ir.Constant(ir.VectorType(_I32, 8), [k + (8 - step if k & step else 0) for k in range(8)])
        second = ir.Constant(ir.VectorType(_I32, 8), [k + (8 if k & step else step) for k in range(8)])
        for k in (k for k in range(8) if not k & step):
            pair = rows[k], rows[k + step]
            rows[k], rows[k + step] = (builder.shuffle_vector(*pair, lanes) for lanes in (first, second))
    return rows


@intrinsic
def low_and_high(typingctx: Any, address: Any) -> Any:
    """8 uint32 at an address: the low 16 bits of each, and the high ones, as float64."""
    vector = Vector(types.float64, 8)
    both = types.UniTuple(vector, 2)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        integers, kind = ir.VectorType(_I32, 8), context.get_value_type(vector)
        loaded = builder.load(_pointer(builder, values[0], integers))
        loaded.align = 4
        low = builder.and_(loaded, ir.Constant(integers, [0xFFFF] * 8))
        high = builder.lshr(loaded, ir.Constant(integers, [16] * 8))
        return context.make_tuple(builder, both, [builder.sitofp(part, kind) for part in (low, high)])

    return both(types.int64), codegen


@intrinsic
def halves(typingctx: Any, vector: Any) -> Any:
    """The two float32 whose bits each float64 of a vector is made of: a vector of the first, and one of the second."""
    half = Vector(types.float32, vector.lanes)
    both = types.UniTuple(half, 2)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        mixed = builder.bitcast(values[0], ir.VectorType(ir.FloatType(), 2 * half.lanes))
        lanes = (list(range(first, 2 * half.lanes, 2)) for first in (0, 1))
        constants = (ir.Constant(ir.VectorType(_I32, half.lanes), of_half) for of_half in lanes)
        parts = [builder.shuffle_vector(mixed, mixed, constant) for constant in constants]
        return context.make_tuple(builder, both, parts)

    return both(vector), codegen


@intrinsic
def store_points(typingctx: Any, x: Any, y: Any, w: Any, address: Any) -> Any:
    """Store x, y, w, w of the first lane of three vectors of 8, then those of the next, and so on."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        x_, y_, w_, address_ = values

        def mixed(a: ir.Value, b: ir.Value, lanes: list[int]) -> ir.Value:
            return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(_I32, 8), lanes))

        for k in range(0, 8, 2):
            two = mixed(x_, y_, [k, 8 + k, k, k, k + 1, 9 + k, k + 1, k + 1])
            points = mixed(two, w_, [0, 1, 8 + k, 8 + k, 4, 5, 9 + k, 9 + k])
            place = builder.add(address_, _I64(32 * k))
            builder.store(points, _pointer(builder, place, points.type)).align = 8
        return context.get_dummy_value()

    return types.void(x, y, w, types.int64), codegen


@intrinsic
def store(typingctx: Any, vector: Any, address: Any) -> Any:
    """Store all lanes at an address, any alignment."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        builder.store(values[0], _pointer(builder, values[1], values[0].type)).align = vector.element.bitwidth // 8
        return context.get_dummy_value()

    return types.void(vector, types.int64), codegen


@intrinsic
def stream(typingctx: Any, vector: Any, address: Any) -> Any:
    """Store all lanes past the caches, at an address that is a multiple of the vector's bytes."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        stored = builder.store(values[0], _pointer(builder, values[1], values[0].type))
        stored.align = vector.lanes * vector.element.bitwidth // 8
        stored.set_metadata("nontemporal", builder.module.add_metadata([_I32(1)]))
        return context.get_dummy_value()

    return types.void(vector, types.int64), codegen


def store_lanes(builder: ir.IRBuilder, bits: ir.Value, value: ir.Value, address: ir.Value) -> None:
    """Store those numbers of 4 bytes whose bit is set, at an address of any alignment."""
    pointer = _pointer(builder, address, value.type)
    if HAS_MASK_REGISTERS:
        kind = ir.FunctionType(ir.VoidType(), [value.type, pointer.type, _I32, bits.type])
        suffix = f"v{value.type.count}{'f32' if isinstance(value.type.element, ir.FloatType) else 'i32'}.p0"
        builder.call(declared(builder, f"llvm.masked.store.{suffix}", kind), [value, pointer, _I32(4), bits])
    else:
        old = builder.load(pointer)
        old.align = 4
        stored = builder.store(builder.select(bits, value, old), pointer)
        stored.align = 4
        stored.volatile = True  # or LLVM makes a masked store of it


@intrinsic
def store_where(typingctx: Any, mask: Any, vector: Any, address: Any) -> Any:
    """Store the lanes of a mask at an address, of 4-byte numbers, any alignment; the others stay."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        store_lanes(builder, unpacked(builder, values[0]), values[1], values[2])
        return context.get_dummy_value()

    return types.void(mask, vector, types.int64), codegen


def _numbers_at(kind: types.Type) -> Any:
    @intrinsic
    def numbers(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            return pointer_at(builder, values[0], context.get_value_type(signature.return_type))

        return types.CPointer(kind)(types.int64), codegen

    return numbers


doubles_at, floats_at = _numbers_at(types.float64), _numbers_at(types.float32)
integers_at, identities_at = _numbers_at(types.int64), _numbers_at(types.uint32)
"""The numbers from an address on, read and written by their place; an array would be counted who holds it."""


@intrinsic
def fetch(typingctx: Any, address: Any) -> Any:
    """Ask for the cache line at an address, which will be read soon; nothing waits for it."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        pointer = _pointer(builder, values[0], ir.IntType(8))
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, _I32, _I32, _I32])
        builder.call(declared(builder, "llvm.prefetch.p0", kind), [pointer, _I32(0), _I32(3), _I32(1)])
        return context.get_dummy_value()

    return types.void(types.int64), codegen
