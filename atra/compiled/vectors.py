"""Vectors: several numbers as one value of Numba code, which becomes one vector of LLVM.

Numba has no vectors, and its auto-vectoriser turns conditions in a loop into a branch per lane. A vector has any number
of lanes; LLVM splits vectors that are wider than the machine's registers.
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
from atra.compiled.intrinsics import emitting

limit_numba()

_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)

HAS_MASK_REGISTERS = native_lanes() == 16 and "avx512vl" in cpu_features()
"""Whether a mask has one bit per lane, as in AVX-512, which makes masked stores cheap.

Elsewhere a mask is a vector of int32, and a masked store writes back what it finds in the other lanes: AVX2's own
masked stores are slow on some processors.
"""


class VectorType(types.Type):
    """`lanes` numbers of one type."""

    def __init__(self, element: types.Type, lanes: int) -> None:
        self.element, self.lanes = element, lanes
        super().__init__(f"VectorType({element}, {lanes})")


class MaskType(types.Type):
    """True or False in each lane."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        super().__init__(f"MaskType({lanes})")


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, vector: VectorType) -> None:
        element = manager.lookup(vector.element).get_value_type()
        super().__init__(manager, vector, ir.VectorType(element, vector.lanes))


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, mask: MaskType) -> None:
        super().__init__(manager, mask, ir.VectorType(_I1 if HAS_MASK_REGISTERS else _I32, mask.lanes))


def packed(builder: ir.IRBuilder, bits: ir.Value) -> ir.Value:
    """Convert the bits of a comparison to a mask; int32 lanes spare repacking where there are no mask registers."""
    return bits if HAS_MASK_REGISTERS else builder.sext(bits, ir.VectorType(_I32, bits.type.count))


def unpacked(builder: ir.IRBuilder, mask: ir.Value) -> ir.Value:
    """Convert a mask to one bit for each lane."""
    return mask if HAS_MASK_REGISTERS else builder.icmp_signed("<", mask, ir.Constant(mask.type, [0] * mask.type.count))


def emit_splat(builder: ir.IRBuilder, value: ir.Value, lanes: int) -> ir.Value:
    """One value in each lane."""
    one = builder.insert_element(ir.Constant(ir.VectorType(value.type, lanes), ir.Undefined), value, _I32(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(_I32, lanes), [0] * lanes))


def every_second(builder: ir.IRBuilder, value: ir.Value, lanes: int) -> list[ir.Value]:
    """The even and the odd lanes of a vector, as two vectors."""
    orders = (ir.Constant(ir.VectorType(_I32, lanes // 2), list(range(first, lanes, 2))) for first in (0, 1))
    return [builder.shuffle_vector(value, value, order) for order in orders]


def declared(builder: ir.IRBuilder, name: str, kind: ir.FunctionType) -> ir.Function:
    """The LLVM function of this name, declared in the module if it is not yet."""
    return builder.module.globals.get(name) or ir.Function(builder.module, kind, name)


def _operator(
    function: Any, kind: type[types.Type], emit: Callable[..., ir.Value], gives_mask: bool = False, count: int = 2
) -> None:
    """Define a Python operator for `count` vectors, or masks, of one type; the result has that type, or is a mask."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) == count and isinstance(arguments[0], kind) and len(set(arguments)) == 1:
                return signature(MaskType(arguments[0].lanes) if gives_mask else arguments[0], *arguments)
            return None

    lower_builtin(function, *[kind] * count)(lambda context, builder, signature, values: emit(builder, *values))


def _comparison(function: Any, sign: str) -> None:
    """Define a comparison of float vectors; it is False where a number is NaN."""
    _operator(function, VectorType, lambda builder, a, b: packed(builder, builder.fcmp_ordered(sign, a, b)), True)


_operator(operator.add, VectorType, ir.IRBuilder.fadd)
_operator(operator.sub, VectorType, ir.IRBuilder.fsub)
_operator(operator.mul, VectorType, ir.IRBuilder.fmul)
_operator(operator.truediv, VectorType, ir.IRBuilder.fdiv)
_operator(operator.and_, MaskType, ir.IRBuilder.and_)
_operator(operator.or_, MaskType, ir.IRBuilder.or_)
_comparison(operator.gt, ">")
_comparison(operator.ge, ">=")
_comparison(operator.le, "<=")
_operator(operator.ne, VectorType, lambda builder, a, b: packed(builder, builder.icmp_unsigned("!=", a, b)), True)


def _between(compare: str) -> Any:
    @intrinsic
    def chosen(typingctx: Any, a: Any, b: Any) -> Any:
        return a(a, b), emitting(lambda builder, a, b: builder.select(builder.fcmp_ordered(compare, a, b), a, b))

    return chosen


smaller = _between("<")
"""smaller(a, b): of two float vectors the smaller in each lane; b where one is NaN."""

larger = _between(">")
"""larger(a, b): of two float vectors the larger in each lane; b where one is NaN."""


def _lane_by_lane(builder: ir.IRBuilder, name: str, *vectors: ir.Value) -> ir.Value:
    """Call LLVM's function `name` on each lane of float vectors of one type."""
    kind = vectors[0].type
    bits = 64 if isinstance(kind.element, ir.DoubleType) else 32
    function = declared(builder, f"llvm.{name}.v{kind.count}f{bits}", ir.FunctionType(kind, [kind] * len(vectors)))
    return builder.call(function, vectors)


def _each(name: str, vector: Any, count: int) -> tuple[Any, Any]:
    """An LLVM function of `count` vectors, applied lane by lane."""
    return vector(*[vector] * count), emitting(lambda builder, *values: _lane_by_lane(builder, name, *values))


def _of_each(name: str) -> Any:
    @intrinsic
    def changed(typingctx: Any, vector: Any) -> Any:
        return _each(name, vector, 1)

    return changed


nearest_whole, ceil, floor = _of_each("rint"), _of_each("ceil"), _of_each("floor")
"""Round each number of a float vector to the nearest whole number, up, and down."""

_operator(abs, VectorType, lambda builder, value: _lane_by_lane(builder, "fabs", value), count=1)


@intrinsic
def signed_like(typingctx: Any, vector: Any, other: Any) -> Any:
    """The numbers of a float vector with the signs of another's."""
    return _each("copysign", vector, 2)


@intrinsic
def fused(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of float vectors, rounded once where the machine can do so, else twice."""
    return _each("fmuladd", a, 3)


@intrinsic
def where(typingctx: Any, mask: Any, a: Any, b: Any) -> Any:
    """a in the lanes of a mask, b in the others."""
    return a(mask, a, b), emitting(lambda builder, mask, a, b: builder.select(unpacked(builder, mask), a, b))


@intrinsic
def folded(typingctx: Any, vector: Any) -> Any:
    """The smaller of each pair of neighbouring lanes: a vector of half as many."""
    half = VectorType(vector.element, vector.lanes // 2)

    def emit(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
        even, odd = every_second(builder, value, vector.lanes)
        return builder.select(builder.fcmp_ordered("<", even, odd), even, odd)

    return half(vector), emitting(emit)


@intrinsic(prefer_literal=True)
def splat(typingctx: Any, value: Any, lanes: Any) -> Any:
    """The same number in each lane."""
    vector = VectorType(types.unliteral(value), lanes.literal_value)
    return vector(vector.element, lanes), emitting(lambda builder, value, _: emit_splat(builder, value, vector.lanes))


@intrinsic(prefer_literal=True)
def arange(typingctx: Any, first: Any, lanes: Any) -> Any:
    """first, first + 1, first + 2, ...; first: float32 or float64."""
    vector = VectorType(first, lanes.literal_value)

    def emit(builder: ir.IRBuilder, first: ir.Value, _: ir.Value) -> ir.Value:
        start = emit_splat(builder, first, vector.lanes)
        return builder.fadd(start, ir.Constant(start.type, [float(lane) for lane in range(vector.lanes)]))

    return vector(first, lanes), emitting(emit)


@intrinsic(prefer_literal=True)
def lane(typingctx: Any, vector: Any, number: Any) -> Any:
    """One number of a vector."""
    place = _I32(number.literal_value)
    return vector.element(vector, number), emitting(lambda builder, value, _: builder.extract_element(value, place))


@intrinsic(prefer_literal=True)
def with_lane(typingctx: Any, vector: Any, number: Any, value: Any) -> Any:
    """A vector with another value in one lane."""
    place = _I32(number.literal_value)
    emit = emitting(lambda builder, vector, _, value: builder.insert_element(vector, value, place))
    return vector(vector, number, vector.element), emit


@intrinsic
def rounded(typingctx: Any, vector: Any) -> Any:
    """Convert float64 to float32."""
    kind = ir.VectorType(ir.FloatType(), vector.lanes)
    return VectorType(types.float32, vector.lanes)(vector), emitting(
        lambda builder, value: builder.fptrunc(value, kind)
    )


@intrinsic
def widened(typingctx: Any, vector: Any) -> Any:
    """Convert float32 to float64."""
    kind = ir.VectorType(ir.DoubleType(), vector.lanes)
    return VectorType(types.float64, vector.lanes)(vector), emitting(lambda builder, value: builder.fpext(value, kind))


@intrinsic
def bits_of(typingctx: Any, mask: Any) -> Any:
    """An int64 with bit k set where lane k is True."""

    def emit(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
        return builder.zext(builder.bitcast(unpacked(builder, value), ir.IntType(mask.lanes)), _I64)

    return types.int64(mask), emitting(emit)


@intrinsic(prefer_literal=True)
def mask_of(typingctx: Any, bits: Any, lanes: Any) -> Any:
    """The mask with lane k True where bit k of an int64 is set."""
    mask = MaskType(lanes.literal_value)

    def emit(builder: ir.IRBuilder, bits: ir.Value, _: ir.Value) -> ir.Value:
        narrow = builder.trunc(bits, ir.IntType(mask.lanes))
        return packed(builder, builder.bitcast(narrow, ir.VectorType(_I1, mask.lanes)))

    return mask(types.int64, lanes), emitting(emit)


@intrinsic
def rarely(typingctx: Any, condition: Any) -> Any:
    """The condition itself; the compiler expects it to be False."""

    def emit(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
        expect = builder.module.declare_intrinsic("llvm.expect", [_I1], ir.FunctionType(_I1, [_I1, _I1]))
        return builder.call(expect, [value, _I1(0)])

    return types.boolean(types.boolean), emitting(emit)


@intrinsic
def multiply_add(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c of float64, rounded once."""
    return types.float64(types.float64, types.float64, types.float64), emitting(ir.IRBuilder.fma)
