"""Vectors: a few numbers side by side as one value in Numba code, which becomes one vector of LLVM's.

Numba itself has none, and what its auto-vectoriser makes of a loop with conditions is a branch per lane. A vector has
any number of lanes; LLVM splits what is wider than the machine's registers.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from atra.compiled.instruction_sets import cpu_features, limit_numba, native_lanes

limit_numba()

_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)

HAS_MASK_REGISTERS = native_lanes() == 16 and "avx512vl" in cpu_features()
"""Whether lanes are switched off by a bit each (AVX-512), and a store that leaves some out is cheap.

Elsewhere a mask is a vector of numbers, and a store writes back what it finds in the lanes it leaves out: AVX2's own
masked stores take many times as long on some processors.
"""


class Vector(types.Type):
    """`lanes` numbers of one type."""

    def __init__(self, element: types.Type, lanes: int) -> None:
        self.element, self.lanes = element, lanes
        super().__init__(f"Vector({element}, {lanes})")


class Mask(types.Type):
    """True or False in each lane."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        super().__init__(f"Mask({lanes})")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, vector: Vector) -> None:
        element = manager.lookup(vector.element).get_value_type()
        super().__init__(manager, vector, ir.VectorType(element, vector.lanes))


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, mask: Mask) -> None:
        super().__init__(manager, mask, ir.VectorType(_I1 if HAS_MASK_REGISTERS else _I32, mask.lanes))


def _packed(builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
    """A comparison's bits -> a mask. Without mask registers bits would be packed and unpacked between blocks."""
    return bits if HAS_MASK_REGISTERS else builder.sext(bits, ir.VectorType(_I32, bits.type.count))


def unpacked(builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
    """A mask -> a bit for each lane."""
    return mask if HAS_MASK_REGISTERS else builder.icmp_signed("<", mask, ir.Constant(mask.type, [0] * mask.type.count))


def splat(builder: ir.IRBuilder, value: ir.Value, lanes: int) -> ir.Value:
    """One value in each lane."""
    one = builder.insert_element(ir.Constant(ir.VectorType(value.type, lanes), ir.Undefined), value, _I32(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(_I32, lanes), [0] * lanes))


def declared(builder: ir.IRBuilder, name: str, kind: ir.FunctionType) -> ir.Function:
    """A function of LLVM's own."""
    return builder.module.globals.get(name) or ir.Function(builder.module, kind, name)


Emit = Callable[[ir.IRBuilder, ir.Value, ir.Value], ir.Value]


def _operator(function: Any, kind: type[types.Type], emit: Emit, gives_mask: bool = False) -> None:
    """Python's operator `function` between two equal vectors, or masks, gives one more of them, or a mask."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) == 2 and isinstance(arguments[0], kind) and arguments[0] == arguments[1]:
                return signature(Mask(arguments[0].lanes) if gives_mask else arguments[0], *arguments)
            return None

    lower_builtin(function, kind, kind)(lambda context, builder, signature, values: emit(builder, *values))


def _comparison(function: Any, sign: str) -> None:
    """Of floats; False where one is NaN."""
    _operator(function, Vector, lambda builder, a, b: _packed(builder, builder.fcmp_ordered(sign, a, b)), True)


_operator(operator.add, Vector, ir.IRBuilder.fadd)
_operator(operator.sub, Vector, ir.IRBuilder.fsub)
_operator(operator.mul, Vector, ir.IRBuilder.fmul)
_operator(operator.truediv, Vector, ir.IRBuilder.fdiv)
_operator(operator.and_, Mask, ir.IRBuilder.and_)
_operator(operator.or_, Mask, ir.IRBuilder.or_)
_comparison(operator.gt, ">")
_comparison(operator.ge, ">=")
_comparison(operator.le, "<=")


def _between(compare: str) -> Any:
    @intrinsic
    def chosen(typingctx: Any, a: Any, b: Any) -> Any:
        def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
            return builder.select(builder.fcmp_ordered(compare, *values), *values)

        return a(a, b), codegen

    return chosen


smaller = _between("<")
"""smaller(a, b): of two float vectors the smaller in each lane; b where one is NaN."""

larger = _between(">")
"""larger(a, b): of two float vectors the larger in each lane; b where one is NaN."""


def _each(name: str, vector: Any, count: int) -> tuple[Any, Any]:
    """A function of LLVM's of so many vectors, lane by lane."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        kind, suffix = values[0].type, f"v{vector.lanes}f{vector.element.bitwidth}"
        function = declared(builder, f"llvm.{name}.{suffix}", ir.FunctionType(kind, [kind] * count))
        return builder.call(function, values)

    return vector(*[vector] * count), codegen


def _of_each(name: str) -> Any:
    @intrinsic
    def changed(typingctx: Any, vector: Any) -> Any:
        return _each(name, vector, 1)

    return changed


nearest_whole, next_whole, last_whole = _of_each("rint"), _of_each("ceil"), _of_each("floor")
"""Of each number of a float vector: the nearest whole number, the first that is not smaller, the last not larger."""

size, root = _of_each("fabs"), _of_each("sqrt")
"""Of each number of a float vector its absolute value; its square root."""


@intrinsic
def signed_like(typingctx: Any, vector: Any, other: Any) -> Any:
    """The numbers of a float vector with the signs of another's."""
    return _each("copysign", vector, 2)


@intrinsic
def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of float vectors, rounded once where the machine can, and twice elsewhere."""
    return _each("fmuladd", a, 3)


@intrinsic
def where(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    """a in the lanes of a mask, b in the others."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.select(unpacked(builder, values[0]), values[1], values[2])

    return a(mask, a, b), codegen


@intrinsic
def folded(typingctx: Any, vector: Any) -> Any:
    """The smaller of each pair of neighbours: half as many lanes."""
    half = Vector(vector.element, vector.lanes // 2)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        even, odd = (
            builder.shuffle_vector(
                values[0], values[0], ir.Constant(ir.VectorType(_I32, half.lanes), list(range(first, vector.lanes, 2)))
            )
            for first in (0, 1)
        )
        return builder.select(builder.fcmp_ordered("<", even, odd), even, odd)

    return half(vector), codegen


@intrinsic(prefer_literal=True)
def repeated(typingctx: Any, value: Any, lanes: Any) -> Any:
    """The same number in each lane."""
    vector = Vector(types.unliteral(value), lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return splat(builder, values[0], vector.lanes)

    return vector(vector.element, lanes), codegen


@intrinsic(prefer_literal=True)
def counted(typingctx: Any, first: Any, lanes: Any) -> Any:
    """first, first + 1, first + 2, ...; first: a float of either width."""
    vector = Vector(first, lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        start = splat(builder, values[0], vector.lanes)
        return builder.fadd(start, ir.Constant(start.type, [float(lane) for lane in range(vector.lanes)]))

    return vector(first, lanes), codegen


@intrinsic(prefer_literal=True)
def lane(typingctx: Any, vector: Any, number: Any) -> Any:
    """One number of a vector."""
    number_ = number.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.extract_element(values[0], _I32(number_))

    return vector.element(vector, number), codegen


@intrinsic(prefer_literal=True)
def with_lane(typingctx: Any, vector: Any, number: Any, value: Any) -> Any:
    """A vector with another value in one lane."""
    number_ = number.literal_value

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.insert_element(values[0], values[2], _I32(number_))

    return vector(vector, number, vector.element), codegen


@intrinsic
def rounded(typingctx: Any, vector: Any) -> Any:
    """float64 -> float32."""
    narrow = Vector(types.float32, vector.lanes)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.fptrunc(values[0], context.get_value_type(narrow))

    return narrow(vector), codegen


@intrinsic
def widened(typingctx: Any, vector: Any) -> Any:
    """float32 -> float64."""
    wide = Vector(types.float64, vector.lanes)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.fpext(values[0], context.get_value_type(wide))

    return wide(vector), codegen


@intrinsic
def bits_of(typingctx: Any, mask: Any) -> Any:
    """An int64 with bit k set where lane k is True."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.zext(builder.bitcast(unpacked(builder, values[0]), ir.IntType(mask.lanes)), _I64)

    return types.int64(mask), codegen


@intrinsic(prefer_literal=True)
def mask_of(typingctx: Any, bits: Any, lanes: Any) -> Any:
    """The mask with lane k True where bit k of an int64 is set."""
    mask = Mask(lanes.literal_value)

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        narrow = builder.trunc(values[0], ir.IntType(mask.lanes))
        return _packed(builder, builder.bitcast(narrow, ir.VectorType(_I1, mask.lanes)))

    return mask(types.int64, lanes), codegen


@intrinsic
def rarely(typingctx: Any, condition: Any) -> Any:
    """The same condition, which the compiler is to expect to be False."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        expect = builder.module.declare_intrinsic("llvm.expect", [_I1], ir.FunctionType(_I1, [_I1, _I1]))
        return builder.call(expect, [values[0], _I1(0)])

    return types.boolean(types.boolean), codegen


@intrinsic
def multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of float64, rounded once."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        return builder.fma(*values)

    return types.float64(types.float64, types.float64, types.float64), codegen
