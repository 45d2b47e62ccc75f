"""One ray tested with every triangle: in float64, and without rounding where that leaves a doubt."""

from __future__ import annotations

from atra.compiled.store import kernel, njit
from atra.exact.lines_kernels import crossing_sign, major_axis, plane_sign

_ERROR = 2e-15
"""Largest error of a volume, as a share of the sum of its products' sizes."""


@njit(forceinline=True)
def _minus(corner, o):  # type: ignore[no-untyped-def]
    return corner[0] - o[0], corner[1] - o[1], corner[2] - o[2]


@njit(forceinline=True)
def _side(d, a, b):  # type: ignore[no-untyped-def]
    """The sign of d . (a x b); 0 where rounding may have decided it."""
    volume = d[0] * (a[1] * b[2] - a[2] * b[1]) + d[1] * (a[2] * b[0] - a[0] * b[2])
    volume += d[2] * (a[0] * b[1] - a[1] * b[0])
    size = abs(d[0]) * (abs(a[1] * b[2]) + abs(a[2] * b[1])) + abs(d[1]) * (abs(a[2] * b[0]) + abs(a[0] * b[2]))
    size += abs(d[2]) * (abs(a[0] * b[1]) + abs(a[1] * b[0]))
    return 0 if abs(volume) <= _ERROR * size else 1 if volume > 0.0 else -1


@kernel
def cross_every_triangle(corners, origin, direction, exact, prim_ids, t):  # type: ignore[no-untyped-def]
    """Write the triangles that a ray crosses and where; returns their number.

    corners: (F, 3, 3) float64. origin, direction: (3,) float64. exact: (PARTS,) float64, memory. prim_ids: (F,) int64.
    t: (F,) float64.
    """
    o, d = (origin[0], origin[1], origin[2]), (direction[0], direction[1], direction[2])
    major, memory, count = major_axis(d[0], d[1], d[2]), exact.ctypes.data, 0
    for face in range(len(corners)):
        p, q, r = corners[face, 0], corners[face, 1], corners[face, 2]
        a, b, c = _minus(p, o), _minus(q, o), _minus(r, o)
        first, second = _side(d, a, b), _side(d, b, c)
        if first * second < 0:
            continue
        third = _side(d, c, a)
        if first * third < 0 or second * third < 0:
            continue
        p, q, r = (p[0], p[1], p[2]), (q[0], q[1], q[2]), (r[0], r[1], r[2])
        sign = first if first * second * third != 0 else crossing_sign(o, d, p, q, r, major, memory)
        if sign == 0 or plane_sign(o, d, p, q, r, 0.0, memory) == -sign:
            continue
        e, f = _minus(q, p), _minus(r, p)
        n = e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]
        facing = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
        prim_ids[count] = face
        t[count] = max((n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) / facing, 0.0) if facing != 0.0 else 0.0
        count += 1
    return count
