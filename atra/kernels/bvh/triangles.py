"""The test of rays and triangles in vectors: four triangles and one ray, or one triangle and a packet of rays."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import njit
from numba.extending import intrinsic

from atra.kernels.raster.vectors import declared, signed_like, size


def _fused(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
    """a b + c, rounded once where the machine does so in one instruction."""
    name = f"llvm.fmuladd.v{a.type.count}f32"
    return builder.call(declared(builder, name, ir.FunctionType(a.type, [a.type] * 3)), [a, b, c])


@intrinsic
def difference(typingctx: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """a b - c d of float32 vectors."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        a_, b_, c_, d_ = values
        return _fused(builder, a_, b_, builder.fneg(builder.fmul(c_, d_)))

    return a(a, a, a, a), codegen


@intrinsic
def product(typingctx: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> Any:
    """a b + c d + e f of float32 vectors."""

    def codegen(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> ir.Value:
        a_, b_, c_, d_, e_, f_ = values
        return _fused(builder, a_, b_, _fused(builder, c_, d_, builder.fmul(e_, f_)))

    return a(a, a, a, a, a, a), codegen


@njit(inline="always")
def meet(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, zero, one):  # type: ignore[no-untyped-def]
    """Where lines meet triangles: (mask of those that do, ray parameter), whatever the parameter is; all are vectors.

    c: from the origins to the first corners; a, b: the edges there; d: directions. A triangle without area meets none.
    Source: T. Moeller, B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997; volumes are compared
    before they are divided, so that signs are all that decides.
    """
    nx, ny, nz = difference(ay, bz, az, by), difference(az, bx, ax, bz), difference(ax, by, ay, bx)
    rx, ry, rz = difference(cy, dz, cz, dy), difference(cz, dx, cx, dz), difference(cx, dy, cy, dx)
    facing = product(nx, dx, ny, dy, nz, dz)
    sign, volume = signed_like(one, facing), size(facing)
    u = product(bx, rx, by, ry, bz, rz) * sign
    v = product(ax, rx, ay, ry, az, rz) * (zero - sign)
    t = product(nx, cx, ny, cy, nz, cz) * sign / volume
    return (u >= zero) & (v >= zero) & (u + v <= volume) & (volume > zero), t
