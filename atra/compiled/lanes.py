"""Lanes: vectors of pixels that lie in a few rows of an image, and the masks by which they are chosen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import pointer_at
from atra.compiled.memory import store_lanes
from atra.compiled.vectors import HAS_MASK_REGISTERS, Mask, Vector, declared

_I1, _I8, _I32, _I64 = ir.IntType(1), ir.IntType(8), ir.IntType(32), ir.IntType(64)


def _bits(builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
    """The bit of each lane, as comparisons and selections have them."""
    return mask if HAS_MASK_REGISTERS else builder.icmp_signed("<", mask, ir.Constant(mask.type, None))


def _mask(builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
    return bits if HAS_MASK_REGISTERS else builder.sext(bits, ir.VectorType(_I32, bits.type.count))


def _load(builder: ir.IRBuilder, kind: ir.Type, address: ir.Value, align: int) -> ir.Value:
    value = builder.load(pointer_at(builder, address, kind.as_pointer()))
    value.align = align
    return value


def _load_rows(
    builder: ir.IRBuilder, kind: ir.Type, first: ir.Value, row_bytes: ir.Value, nx: int, ny: int
) -> ir.Value:
    """ny rows of nx neighbouring numbers -> one vector; ny is a power of two."""
    align = kind.width // 8 if isinstance(kind, ir.IntType) else 4
    rows = [
        _load(builder, ir.VectorType(kind, nx), builder.add(first, builder.mul(row_bytes, _I64(row))), align)
        for row in range(ny)
    ]
    while len(rows) > 1:
        lanes = 2 * rows[0].type.count
        order = ir.Constant(ir.VectorType(_I32, lanes), list(range(lanes)))
        rows = [builder.shuffle_vector(a, b, order) for a, b in zip(rows[::2], rows[1::2], strict=True)]
    return rows[0]


@intrinsic(prefer_literal=True)
def load_rows(typingctx: Any, address: Any, row_bytes: Any, like: Any, lanes: Any, nx: Any) -> Any:
    """Numbers of four bytes from rows of nx of them, the first at an address, any alignment; like: one of theirs."""
    columns, rows = nx.literal_value, lanes.literal_value // nx.literal_value
    vector = Vector(types.unliteral(like), lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        kind = context.get_value_type(vector.element)
        return _load_rows(builder, kind, values[0], values[1], columns, rows)

    return vector(types.int64, types.int64, vector.element, lanes, nx), codegen


@intrinsic(prefer_literal=True)
def store_rows(typingctx: Any, vector: Any, address: Any, row_bytes: Any, nx: Any) -> Any:
    """The reverse of `load_rows`."""
    columns, rows = nx.literal_value, vector.lanes // nx.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        value, first, row_bytes_ = values[:3]
        for row in range(rows):
            lanes = ir.Constant(ir.VectorType(_I32, columns), list(range(row * columns, (row + 1) * columns)))
            part = builder.shuffle_vector(value, value, lanes) if rows > 1 else value
            address_ = builder.add(first, builder.mul(row_bytes_, _I64(row)))
            builder.store(part, pointer_at(builder, address_, part.type.as_pointer())).align = 4
        return context.get_dummy_value()

    return types.void(vector, types.int64, types.int64, nx), codegen


@intrinsic(prefer_literal=True)
def store_rows_where(typingctx: Any, mask: Any, vector: Any, address: Any, row_bytes: Any, nx: Any) -> Any:
    """`store_rows` of the lanes of a mask; what the others would be stored to stays."""
    columns, rows = nx.literal_value, vector.lanes // nx.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        bits, value, first, row_bytes_ = _bits(builder, values[0]), *values[1:4]
        for row in range(rows):
            lanes = ir.Constant(ir.VectorType(_I32, columns), list(range(row * columns, (row + 1) * columns)))
            part, which = (builder.shuffle_vector(one, one, lanes) if rows > 1 else one for one in (value, bits))
            store_lanes(builder, which, part, builder.add(first, builder.mul(row_bytes_, _I64(row))))
        return context.get_dummy_value()

    return types.void(mask, vector, types.int64, types.int64, nx), codegen


def _places(of_lane: Callable[[int, int], int]) -> Any:
    @intrinsic(prefer_literal=True)
    def places(typingctx: Any, lanes: Any, nx: Any) -> Any:
        vector, columns = Vector(types.float32, lanes.literal_value), nx.literal_value

        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            kind = context.get_value_type(vector)
            return ir.Constant(kind, [float(of_lane(lane, columns)) for lane in range(vector.lanes)])

        return vector(lanes, nx), codegen

    return places


columns_of, rows_of = _places(lambda lane, nx: lane % nx), _places(lambda lane, nx: lane // nx)
"""columns_of(lanes, nx), rows_of(lanes, nx): float32 vectors, which column and row each pixel is in."""


@intrinsic(prefer_literal=True)
def marked_rows(typingctx: Any, address: Any, row_bytes: Any, mark: Any, lanes: Any, nx: Any) -> Any:
    """The mask of the pixels whose byte, laid out as for `load_rows`, shares a bit with `mark`."""
    columns, rows = nx.literal_value, lanes.literal_value // nx.literal_value
    mask = Mask(lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        marks = _load_rows(builder, _I8, values[0], values[1], columns, rows)
        mark_ = builder.trunc(values[2], _I8)
        one = builder.insert_element(ir.Constant(marks.type, ir.Undefined), mark_, _I32(0))
        same = builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(_I32, mask.lanes), [0] * mask.lanes))
        shared = builder.and_(marks, same)
        return _mask(builder, builder.icmp_signed("!=", shared, ir.Constant(marks.type, None)))

    return mask(types.int64, types.int64, types.int64, lanes, nx), codegen


@intrinsic(prefer_literal=True)
def nonzero_lanes(typingctx: Any, address: Any, lanes: Any) -> Any:
    """The mask of the int32 at an address that are not 0."""
    mask = Mask(lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        numbers = _load(builder, ir.VectorType(_I32, mask.lanes), values[0], 4)
        return _mask(builder, builder.icmp_signed("!=", numbers, ir.Constant(numbers.type, None)))

    return mask(types.int64, lanes), codegen


@intrinsic
def chosen(typingctx: Any, mask: Any, this: Any, other: Any) -> Any:
    """`this` where the mask is True, elsewhere `other`."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.select(_bits(builder, values[0]), values[1], values[2])

    return this(mask, this, this), codegen


@intrinsic
def either(typingctx: Any, a: Any, b: Any) -> Any:
    """The mask of the lanes of both masks."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.or_(*values)

    return a(a, a), codegen


@intrinsic
def one_more(typingctx: Any, mask: Any, numbers: Any) -> Any:
    """Whole numbers, one larger where the mask is True."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        more = builder.add(values[1], ir.Constant(values[1].type, [1] * numbers.lanes))
        return builder.select(_bits(builder, values[0]), more, values[1])

    return numbers(mask, numbers), codegen


def _compared(sign: str) -> Any:
    @intrinsic
    def compared(typingctx: Any, a: Any, b: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            return _mask(builder, builder.icmp_unsigned(sign, *values))

        return Mask(a.lanes)(a, b), codegen

    return compared


is_below, is_same, is_from = _compared("<"), _compared("=="), _compared(">=")
"""The masks where an unsigned whole number of a vector is less than that of another, the same, and not less."""


@intrinsic
def highest(typingctx: Any, numbers: Any) -> Any:
    """The highest of a vector of uint32, as int64."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        kind = ir.FunctionType(_I32, [values[0].type])
        return builder.zext(
            builder.call(declared(builder, f"llvm.vector.reduce.umax.v{numbers.lanes}i32", kind), values), _I64
        )

    return types.int64(numbers), codegen


@intrinsic
def first_bit(typingctx: Any, bits: Any) -> Any:
    """The place of the lowest bit that is set of an int64 that is not 0."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.cttz(values[0], _I1(1))

    return types.int64(types.int64), codegen


def _number_at(kind: types.Type) -> Any:
    @intrinsic
    def number_at(typingctx: Any, address: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            return builder.load(pointer_at(builder, values[0], _I32.as_pointer()))

        return kind(types.int64), codegen

    return number_at


int32_at = _number_at(types.int32)
"""The int32 at an address."""

uint32_at = _number_at(types.uint32)
"""The uint32 at an address."""


@intrinsic
def set_int64(typingctx: Any, address: Any, value: Any) -> Any:
    """Store an int64 at an address."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        builder.store(values[1], pointer_at(builder, values[0], _I64.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen
