"""Memory by its address: vectors and single numbers of Numba code read and written, gathered, and asked for ahead."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.kernels.raster.vectors import HAS_MASK_REGISTERS, Vector, declared, splat, unpacked

_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


def _pointer(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type) -> ir.Value:
    return builder.inttoptr(address, kind.as_pointer())


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
    pointers = builder.inttoptr(addresses, ir.VectorType(kind.element.as_pointer(), kind.count))
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


@intrinsic(prefer_literal=True)
def gather_rows(typingctx: Any, base: Any, numbers_address: Any, row_bytes: Any) -> Any:
    """8 float64, the first of each of the rows from an address on whose numbers, 8 uint32, stand at another."""
    vector, size = Vector(types.float64, 8), row_bytes.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        loaded = builder.load(_pointer(builder, values[1], ir.VectorType(_I32, 8)))
        loaded.align = 4
        integers = ir.VectorType(_I64, 8)
        distances = builder.mul(builder.zext(loaded, integers), ir.Constant(integers, [size] * 8))
        addresses = builder.add(distances, splat(builder, values[0], 8))
        return _gathered(builder, addresses, context.get_value_type(vector), "v8f64", 8)

    return vector(types.int64, types.int64, row_bytes), codegen


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
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

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
