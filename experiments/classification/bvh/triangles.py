"""The ray-triangle test, on vectors: four triangles and one ray, or one triangle and a packet of rays."""

from __future__ import annotations

from atra.compiled.store import njit
from atra.compiled.vectors import fused, signed_like


@njit(forceinline=True)
def _difference(a, b, c, d, zero):  # type: ignore[no-untyped-def]
    """a b - c d."""
    return fused(a, b, zero - c * d)


@njit(forceinline=True)
def _product(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """a b + c d + e f."""
    return fused(a, b, fused(c, d, e * f))


@njit(forceinline=True)
def meet(x0, y0, z0, x1, y1, z1, x2, y2, z2, x, y, z, dx, dy, dz, zero, one):  # type: ignore[no-untyped-def]
    """(mask of lines that meet their triangle, ray parameter), by the triangles' corners and the lines' origins and
    directions; all arguments are vectors. Parameters may be negative.

    A triangle without area is never met. Source: T. Moeller, B. Trumbore, "Fast, minimum storage ray/triangle
    intersection", 1997; volumes are compared before the division, so that only signs decide.
    """
    cx, cy, cz = x0 - x, y0 - y, z0 - z
    ax, ay, az, bx, by, bz = x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0
    rx, ry = _difference(cy, dz, cz, dy, zero), _difference(cz, dx, cx, dz, zero)
    rz = _difference(cx, dy, cy, dx, zero)
    nx, ny = _difference(ay, bz, az, by, zero), _difference(az, bx, ax, bz, zero)
    nz = _difference(ax, by, ay, bx, zero)
    facing = _product(nx, dx, ny, dy, nz, dz)
    sign, volume = signed_like(one, facing), abs(facing)
    u = _product(bx, rx, by, ry, bz, rz) * sign
    v = _product(ax, rx, ay, ry, az, rz) * (zero - sign)
    t = _product(nx, cx, ny, cy, nz, cz) * sign / volume
    return (u >= zero) & (v >= zero) & (u + v <= volume) & (volume > zero), t
