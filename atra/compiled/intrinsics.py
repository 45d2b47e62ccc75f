"""Machine operations that Numba lacks: atomic addition, a clock, and single numbers read by address."""

from __future__ import annotations

from collections.abc import Callable
from platform import machine
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_I64 = ir.IntType(64)


def emitting(emit: Callable[..., ir.Value | None]) -> Callable[..., Any]:
    """Turn `emit(builder, *values)` into a code generator as Numba calls it; a result of None stands for none."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> Any:
        result = emit(builder, *values)
        return context.get_dummy_value() if result is None else result

    return codegen


def pointer_at(builder: ir.IRBuilder, address: ir.Value, kind: ir.Type) -> ir.Value:
    """Convert an int64 address to a pointer of type `kind`.

    Numba optimises a function again after linking it into another. By then LLVM may take a part of the address for the
    pointer, and it assumes that a null pointer is never read: of `first + (16 if second else 0)` only 16 was left.
    """
    set.add(builder.function.attributes, "null_pointer_is_valid")  # llvmlite's own `add` has not heard of it
    return builder.inttoptr(address, kind)


@intrinsic
def fetch_add(typingctx: Any, address: Any, value: Any) -> Any:
    """Add `value` to the int64 at `address` atomically and return its former value."""

    def emit(builder: ir.IRBuilder, address: ir.Value, value: ir.Value) -> ir.Value:
        return builder.atomic_rmw("add", pointer_at(builder, address, _I64.as_pointer()), value, "monotonic")

    return types.int64(types.int64, types.int64), emitting(emit)


@intrinsic
def ticks(typingctx: Any) -> Any:
    """The processor's clock, which counts at a constant rate."""

    def emit(builder: ir.IRBuilder) -> ir.Value:
        kind = ir.FunctionType(_I64, [])
        if machine().lower() in ("arm64", "aarch64"):  # programs may not read the register that LLVM reads there
            return builder.asm(kind, "mrs $0, cntvct_el0", "=r", [], side_effect=True)
        return builder.call(builder.module.declare_intrinsic("llvm.readcyclecounter", [], kind), [])

    return types.int64(), emitting(emit)


def _number_at(kind: types.Type, llvm_kind: ir.Type) -> Any:
    @intrinsic
    def number_at(typingctx: Any, address: Any) -> Any:
        def emit(builder: ir.IRBuilder, address: ir.Value) -> ir.Value:
            return builder.load(pointer_at(builder, address, llvm_kind.as_pointer()))

        return kind(types.int64), emitting(emit)

    return number_at


float_at = _number_at(types.float32, ir.FloatType())
"""The float32 at an address."""

int32_at, uint32_at = (_number_at(kind, ir.IntType(32)) for kind in (types.int32, types.uint32))
"""The int32 and the uint32 at an address."""

address_at = _number_at(types.int64, _I64)
"""The pointer at an address."""
