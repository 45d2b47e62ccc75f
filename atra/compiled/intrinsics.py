"""The machine-level operations Numba has no words for: an atomic counter, a clock, and memory by its address."""

from __future__ import annotations

from platform import machine
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_I16, _I64 = ir.IntType(16), ir.IntType(64)
_F32, _F64 = ir.FloatType(), ir.DoubleType()


def pointer_at(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type) -> ir.Value:
    """An address -> a pointer of this kind.

    Numba links a function into others as its compilation has left it, and optimises it once more. By then LLVM may take
    a part of the address for the pointer, and, unless told otherwise, that a null pointer is never read: of
    `first + (16 if second else 0)` only 16 was left.
    """
    set.add(builder.function.attributes, "null_pointer_is_valid")  # llvmlite's own `add` has not heard of it
    return builder.inttoptr(address, kind)


@intrinsic
def fetch_add(typingctx: Any, address: Any, value: Any) -> Any:
    """Add `value` to the int64 at `address`, atomically; returns what was there before."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        pointer = pointer_at(builder, arguments[0], _I64.as_pointer())
        return builder.atomic_rmw("add", pointer, arguments[1], "monotonic")

    return types.int64(types.int64, types.int64), codegen


@intrinsic
def ticks(typingctx: Any) -> Any:
    """What an even clock of the processor shows; reading it takes some ten nanoseconds."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        kind = ir.FunctionType(_I64, [])
        if machine().lower() in ("arm64", "aarch64"):  # what LLVM reads there is kept from programs
            return builder.asm(kind, "mrs $0, cntvct_el0", "=r", [], side_effect=True)
        return builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", [], kind), [])

    return types.int64(), codegen


@intrinsic
def float_at(typingctx: Any, address: Any) -> Any:
    """The float32 at an address."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        return builder.load(pointer_at(builder, arguments[0], _F32.as_pointer()))

    return types.float32(types.int64), codegen


@intrinsic
def address_at(typingctx: Any, address: Any) -> Any:
    """The pointer at an address."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        return builder.load(pointer_at(builder, arguments[0], _I64.as_pointer()))

    return types.int64(types.int64), codegen


@intrinsic
def add_at(typingctx: Any, address: Any, value: Any) -> Any:
    """Add to the float64 at an address."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        pointer = pointer_at(builder, arguments[0], _F64.as_pointer())
        builder.store(builder.fadd(builder.load(pointer), arguments[1]), pointer)
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), codegen


@intrinsic
def set_bits_at(typingctx: Any, address: Any, bits: Any) -> Any:
    """Set bits, an int64 below 2^16, of the uint16 at an address."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, arguments: list[ir.Value]) -> ir.Value:
        pointer = pointer_at(builder, arguments[0], _I16.as_pointer())
        builder.store(builder.or_(builder.load(pointer), builder.trunc(arguments[1], _I16)), pointer)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), codegen
