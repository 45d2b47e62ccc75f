"""Vectors of pixels that lie in a few rows of an image, and masks that choose among their lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import emitting, pointer_at
from atra.compiled.memory import load_aligned, store_lanes
from atra.compiled.vectors import HAS_MASK_REGISTERS, MaskType, VectorType, declared, emit_splat, packed, unpacked

_I1, _I8, _I32, _I64 = ir.IntType(1), ir.IntType(8), ir.IntType(32), ir.IntType(64)


def emit_load_rows(
    builder: ir.IRBuilder, kind: ir.Type, first: ir.Value, row_bytes: ir.Value, nx: int, ny: int
) -> ir.Value:
    """Emit the load of ny rows of nx neighbouring numbers of type `kind` as one vector; ny is a power of two."""
    align = kind.width // 8 if isinstance(kind, ir.IntType) else 4
    rows = [
        load_aligned(builder, builder.add(first, builder.mul(row_bytes, _I64(row))), ir.VectorType(kind, nx), align)
        for row in range(ny)
    ]
    while len(rows) > 1:
        lanes = 2 * rows[0].type.count
        order = ir.Constant(ir.VectorType(_I32, lanes), list(range(lanes)))
        rows = [builder.shuffle_vector(a, b, order) for a, b in zip(rows[::2], rows[1::2], strict=True)]
    return rows[0]


def emit_store_rows(
    builder: ir.IRBuilder,
    value: ir.Value,
    first: ir.Value,
    row_bytes: ir.Value,
    nx: int,
    bits: ir.Value | None = None,
) -> None:
    """Emit the reverse of `emit_load_rows` for numbers of 4 bytes; bits: of the lanes to store, None = all."""

    def part(vector: ir.Value, row: int) -> ir.Value:
        if vector.type.count == nx:
            return vector
        lanes = ir.Constant(ir.VectorType(_I32, nx), list(range(row * nx, (row + 1) * nx)))
        return builder.shuffle_vector(vector, vector, lanes)

    for row in range(value.type.count // nx):
        place, stored = builder.add(first, builder.mul(row_bytes, _I64(row))), part(value, row)
        if bits is None:
            builder.store(stored, pointer_at(builder, place, stored.type.as_pointer())).align = 4
        else:
            store_lanes(builder, part(bits, row), stored, place)


@intrinsic(prefer_literal=True)
def load_rows(typingctx: Any, address: Any, row_bytes: Any, like: Any, lanes: Any, nx: Any) -> Any:
    """Load `lanes` numbers of 4 bytes from rows of nx; address: of the first, any alignment. like: gives their type."""
    columns, rows = nx.literal_value, lanes.literal_value // nx.literal_value
    vector = VectorType(types.unliteral(like), lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return emit_load_rows(builder, context.get_value_type(vector.element), values[0], values[1], columns, rows)

    return vector(types.int64, types.int64, vector.element, lanes, nx), codegen


@intrinsic(prefer_literal=True)
def store_rows(typingctx: Any, vector: Any, address: Any, row_bytes: Any, nx: Any) -> Any:
    """Store a vector as `load_rows` loads it."""

    def emit(builder: ir.IRBuilder, value: ir.Value, address: ir.Value, row_bytes: ir.Value, _: ir.Value) -> None:
        emit_store_rows(builder, value, address, row_bytes, nx.literal_value)

    return types.void(vector, types.int64, types.int64, nx), emitting(emit)


@intrinsic(prefer_literal=True)
def store_rows_where(typingctx: Any, mask: Any, vector: Any, address: Any, row_bytes: Any, nx: Any) -> Any:
    """`store_rows` for the lanes of a mask only."""

    def emit(builder: ir.IRBuilder, mask: ir.Value, value: ir.Value, *where: ir.Value) -> None:
        emit_store_rows(builder, value, where[0], where[1], nx.literal_value, unpacked(builder, mask))

    return types.void(mask, vector, types.int64, types.int64, nx), emitting(emit)


def _places(of_lane: Callable[[int, int], int]) -> Any:
    @intrinsic(prefer_literal=True)
    def places(typingctx: Any, lanes: Any, nx: Any) -> Any:
        vector, columns = VectorType(types.float32, lanes.literal_value), nx.literal_value

        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            kind = context.get_value_type(vector)
            return ir.Constant(kind, [float(of_lane(lane, columns)) for lane in range(vector.lanes)])

        return vector(lanes, nx), codegen

    return places


pixel_columns, pixel_rows = _places(lambda lane, nx: lane % nx), _places(lambda lane, nx: lane // nx)
"""pixel_columns(lanes, nx), pixel_rows(lanes, nx): float32 vectors of the column and of the row of each pixel."""


@intrinsic(prefer_literal=True)
def marked_rows(typingctx: Any, address: Any, row_bytes: Any, mark: Any, lanes: Any, nx: Any) -> Any:
    """The mask of the pixels whose byte, laid out as for `load_rows`, shares a bit with `mark`."""
    columns, rows = nx.literal_value, lanes.literal_value // nx.literal_value
    mask = MaskType(lanes.literal_value)

    def emit(builder: ir.IRBuilder, address: ir.Value, row_bytes: ir.Value, mark: ir.Value, *_: ir.Value) -> ir.Value:
        marks = emit_load_rows(builder, _I8, address, row_bytes, columns, rows)
        shared = builder.and_(marks, emit_splat(builder, builder.trunc(mark, _I8), mask.lanes))
        return packed(builder, builder.icmp_signed("!=", shared, ir.Constant(marks.type, None)))

    return mask(types.int64, types.int64, types.int64, lanes, nx), emitting(emit)


@intrinsic(prefer_literal=True)
def nonzero_lanes(typingctx: Any, address: Any, lanes: Any) -> Any:
    """The mask of the int32 at an address that are not 0."""
    mask = MaskType(lanes.literal_value)

    def emit(builder: ir.IRBuilder, address: ir.Value, _: ir.Value) -> ir.Value:
        numbers = load_aligned(builder, address, ir.VectorType(_I32, mask.lanes), 4)
        return packed(builder, builder.icmp_signed("!=", numbers, ir.Constant(numbers.type, None)))

    return mask(types.int64, lanes), emitting(emit)


@intrinsic
def one_more(typingctx: Any, mask: Any, numbers: Any) -> Any:
    """A vector of whole numbers with 1 added in the lanes of a mask."""

    def emit(builder: ir.IRBuilder, mask: ir.Value, values: ir.Value) -> ir.Value:
        more = builder.add(values, ir.Constant(values.type, [1] * numbers.lanes))
        return builder.select(unpacked(builder, mask), more, values)

    return numbers(mask, numbers), emitting(emit)


def _compared(sign: str) -> Any:
    @intrinsic
    def compared(typingctx: Any, a: Any, b: Any) -> Any:
        return MaskType(a.lanes)(a, b), emitting(
            lambda builder, a, b: packed(builder, builder.icmp_unsigned(sign, a, b))
        )

    return compared


is_below, is_same, is_from = _compared("<"), _compared("=="), _compared(">=")
"""Masks of the lanes in which one vector of unsigned whole numbers is <, == and >= another."""


@intrinsic
def highest(typingctx: Any, numbers: Any) -> Any:
    """The highest of a vector of uint32, as int64."""

    def emit(builder: ir.IRBuilder, values: ir.Value) -> ir.Value:
        kind = ir.FunctionType(_I32, [values.type])
        reduce = declared(builder, f"llvm.vector.reduce.umax.v{numbers.lanes}i32", kind)
        return builder.zext(builder.call(reduce, [values]), _I64)

    return types.int64(numbers), emitting(emit)


@intrinsic
def first_bit(typingctx: Any, bits: Any) -> Any:
    """The place of the lowest bit that is set in an int64 that is not 0."""
    return types.int64(types.int64), emitting(lambda builder, bits: builder.cttz(bits, _I1(1)))


@intrinsic
def store_chosen(typingctx: Any, bits: Any, source: Any, target: Any) -> Any:
    """Store those of 8 uint64 at the address `source` whose bit is set one after another at `target`, which has room
    for all; returns how many."""

    def emit(builder: ir.IRBuilder, bits: ir.Value, source: ir.Value, target: ir.Value) -> ir.Value:
        kind, chosen = ir.VectorType(_I64, 8), builder.trunc(bits, ir.IntType(8))
        if HAS_MASK_REGISTERS:
            numbers, mask = load_aligned(builder, source, kind, 8), builder.bitcast(chosen, ir.VectorType(_I1, 8))
            name = "llvm.x86.avx512.mask.compress.v8i64"
            compress = declared(builder, name, ir.FunctionType(kind, [kind, kind, mask.type]))
            together = builder.call(compress, [numbers, numbers, mask])
            builder.store(together, pointer_at(builder, target, kind.as_pointer())).align = 8
            return builder.zext(builder.ctpop(chosen), _I64)
        count: ir.Value = _I64(0)
        for k in range(8):
            number = load_aligned(builder, builder.add(source, _I64(8 * k)), _I64, 8)
            place = builder.add(target, builder.shl(count, _I64(3)))
            builder.store(number, pointer_at(builder, place, _I64.as_pointer())).align = 8
            count = builder.add(count, builder.and_(builder.lshr(bits, _I64(k)), _I64(1)))
        return count

    return types.int64(types.int64, types.int64, types.int64), emitting(emit)
