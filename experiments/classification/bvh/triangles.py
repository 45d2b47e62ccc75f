"""The ray-triangle tests, on vectors: four triangles and one ray, or one triangle and a packet of rays."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.extending import intrinsic

from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, declared, larger, rarely, signed_like, smaller, where, widened

CLAMP_SLACK = 2.0**-20
"""Relative margin by which a hit's parameter may lie outside those of the triangle's corners: sixteen roundings."""


def _fused(builder: ir.IRBuilder, a: ir.Value, b: ir.Value, c: ir.Value) -> ir.Value:
    """a b + c, as one fused instruction where the machine has it."""
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


@njit(forceinline=True)
def _plane(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, one):  # type: ignore[no-untyped-def]
    """(sign and size of normal . direction, ray parameter) where lines meet the triangles' planes; arguments as in
    `meet`."""
    nx, ny, nz = difference(ay, bz, az, by), difference(az, bx, ax, bz), difference(ax, by, ay, bx)
    facing = product(nx, dx, ny, dy, nz, dz)
    sign, volume = signed_like(one, facing), abs(facing)
    return sign, volume, product(nx, cx, ny, cy, nz, cz) * sign / volume


@njit(forceinline=True)
def meet(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, zero, one):  # type: ignore[no-untyped-def]
    """(mask of lines that meet their triangle, ray parameter); all arguments are vectors. Parameters may be negative.

    c: from the origins to the first corners. a, b: the edges there. d: directions. A triangle without area is never
    met. Source: T. Moeller, B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997; volumes are compared
    before the division, so that only signs decide.
    """
    rx, ry, rz = difference(cy, dz, cz, dy), difference(cz, dx, cx, dz), difference(cx, dy, cy, dx)
    sign, volume, t = _plane(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, one)
    u = product(bx, rx, by, ry, bz, rz) * sign
    v = product(ax, rx, ay, ry, az, rz) * (zero - sign)
    return (u >= zero) & (v >= zero) & (u + v <= volume) & (volume > zero), t


@njit(forceinline=True)
def meet_corners(  # type: ignore[no-untyped-def]
    robust, x0, y0, z0, x1, y1, z1, x2, y2, z2, x, y, z, dx, dy, dz, shear, zero, one, slack
):
    """`meet_closed` if `robust`, else `meet`, for triangles by their corners and lines by their origins (x, y, z)."""
    cx, cy, cz = x0 - x, y0 - y, z0 - z
    ax, ay, az, bx, by, bz = x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0
    if robust:
        ex, ey, ez, fx, fy, fz = x1 - x, y1 - y, z1 - z, x2 - x, y2 - y, z2 - z
        return meet_closed(
            cx, cy, cz, ex, ey, ez, fx, fy, fz, ax, ay, az, bx, by, bz, dx, dy, dz, shear, zero, one, slack
        )
    return meet(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, zero, one)


@njit(forceinline=True)
def _turned(is_x, is_y, x, y, z):  # type: ignore[no-untyped-def]
    """Rotate components so that the major axis comes last; a rotation keeps orientation."""
    return where(is_x, y, where(is_y, z, x)), where(is_x, z, where(is_y, x, y)), where(is_x, x, where(is_y, y, z))


@njit(forceinline=True)
def _areas(px, py, qx, qy, rx, ry):  # type: ignore[no-untyped-def]
    """Smallest and largest of the areas between the origin and the triangles' edges."""
    u, v, w = rx * qy - ry * qx, px * ry - py * rx, qx * py - qy * px
    return smaller(smaller(u, v), w), larger(larger(u, v), w)


@njit(forceinline=True)
def shear_of(dx, dy, dz, zero, one):  # type: ignore[no-untyped-def]
    """(major axis is x, major axis is y, shear x, shear y, 1 / major component) of directions: the shear that lays a
    direction onto its major axis. See `meet_closed`."""
    is_x = (abs(dx) >= abs(dy)) & (abs(dx) >= abs(dz))
    is_y = abs(dy) >= abs(dz)  # if not x
    across, along, away = _turned(is_x, is_y, dx, dy, dz)
    return is_x, is_y, across / away, along / away, one / away


@njit(forceinline=True)
def meet_closed(  # type: ignore[no-untyped-def]
    cx, cy, cz, ex, ey, ez, fx, fy, fz, ax, ay, az, bx, by, bz, dx, dy, dz, shear, zero, one, slack
):
    """As `meet`, but watertight: no line passes between triangles that share an edge or a corner.

    c, e, f: from the origins to the three corners. a, b, d: as for `meet`. shear: from `shear_of`. slack: CLAMP_SLACK.
    Each corner is sheared on its own, so triangles that share it agree on its place. The side of an edge is then
    decided exactly: float32 products round alike for both triangles at the edge, so their difference has the right sign
    or is 0; float64, where those products are exact, decides a 0. A line through an edge hits both triangles. Source:
    S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle intersection", 2013. The parameter comes from the plane,
    clamped to those of the corners; it is more precise than the paper's mean weighted by areas.
    """
    is_x, is_y, sx, sy, inverse = shear
    px, py, pz = _turned(is_x, is_y, cx, cy, cz)
    qx, qy, qz = _turned(is_x, is_y, ex, ey, ez)
    rx, ry, rz = _turned(is_x, is_y, fx, fy, fz)
    px, py, qx, qy, rx, ry = px - sx * pz, py - sy * pz, qx - sx * qz, qy - sy * qz, rx - sx * rz, ry - sy * rz
    least, most = _areas(px, py, qx, qy, rx, ry)
    hits = (least >= zero) | (zero >= most)
    on_edge = hits & (((zero >= least) & (least >= zero)) | ((zero >= most) & (most >= zero)))
    if rarely(bits_of(on_edge) != 0):
        none = widened(zero)
        least, most = _areas(widened(px), widened(py), widened(qx), widened(qy), widened(rx), widened(ry))
        hits = hits & ((least >= none) | (none >= most)) & ((none > least) | (most > none))
    _, _, t = _plane(cx, cy, cz, ax, ay, az, bx, by, bz, dx, dy, dz, one)
    pz, qz, rz = pz * inverse, qz * inverse, rz * inverse
    near, far = smaller(smaller(pz, qz), rz), larger(larger(pz, qz), rz)
    near, far = near - abs(near) * slack, far + abs(far) * slack
    return hits, larger(smaller(t, far), near)
