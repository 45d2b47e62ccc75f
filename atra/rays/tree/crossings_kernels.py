"""Crossings of one ray and the triangles of a tree: each exactly once.

Triangles are tested in float64, four at a time, with a bound of the error; where
that tells nothing `atra.exact.lines_kernels` decides.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at, uint32_at
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, smaller, splat, widened
from atra.exact.lines_kernels import (
    crossing_sign,
    major_axis,
    plane_order,
    plane_parameter,
    plane_sign,
    touching_sign,
)
from atra.exact.sums_kernels import UNIT, out_of_line
from atra.trees.layout import BLOCK, IDS

_ZERO = np.float32(0.0)

_ROW = 4 * BLOCK
"""Bytes of a block's row: one coordinate of one corner of each triangle."""

_VECTOR = 8 * BLOCK
"""Bytes of a vector of float64, one of each triangle."""

AREAS = 7 * BLOCK
"""Numbers that `candidates` writes."""

PRECISE = 2.0**-34
"""Share of a triangle's area up to which its error leaves t precise."""

ROUNDINGS = 16.0
"""Largest error of a sheared corner, in roundings of the largest distance to the mesh; there are 7."""


@njit(forceinline=True)
def line_of(o, d, sphere):  # type: ignore[no-untyped-def]
    """What triangle tests need of a ray: origin and shear as vectors, its axes' places in a block, and error bounds."""
    cx, cy, cz, radius = sphere
    major = major_axis(d[0], d[1], d[2])
    one, other = (major + 1) % 3, (major + 2) % 3
    ox = o[0] if one == 0 else o[1] if one == 1 else o[2]
    oy = o[0] if other == 0 else o[1] if other == 1 else o[2]
    oz = o[0] if major == 0 else o[1] if major == 1 else o[2]
    dx = d[0] if one == 0 else d[1] if one == 1 else d[2]
    dy = d[0] if other == 0 else d[1] if other == 1 else d[2]
    dz = d[0] if major == 0 else d[1] if major == 1 else d[2]
    reach = max(abs(cx - o[0]), abs(cy - o[1]), abs(cz - o[2])) + radius
    error = ROUNDINGS * UNIT * reach
    inverse = 1.0 / dz
    return (
        (splat(ox, BLOCK), splat(oy, BLOCK), splat(oz, BLOCK)),
        (splat(-dx * inverse, BLOCK), splat(-dy * inverse, BLOCK)),
        (one * _ROW, other * _ROW, major * _ROW),
        (splat(error, BLOCK), splat(error * error, BLOCK)),
        major,
        inverse,
    )  # fmt: skip


@njit(forceinline=True)
def laid_corner(place, origin, shear, rows):  # type: ignore[no-untyped-def]
    """A corner of four triangles, from an address, laid along a ray onto the plane across its major axis."""
    z = widened(load(place + rows[2], _ZERO, BLOCK)) - origin[2]
    x = fused(shear[0], z, widened(load(place + rows[0], _ZERO, BLOCK)) - origin[0])
    return x, fused(shear[1], z, widened(load(place + rows[1], _ZERO, BLOCK)) - origin[1]), z


@njit(forceinline=True)
def areas_of(p, q, r, error, square):  # type: ignore[no-untyped-def]
    """(twice the areas opposite three laid corners; the bound of their error; the least and the largest area; mask of
    the triangles that a line may cross). error: of a corner. square: of a product of two such."""
    u, v, w = q[0] * r[1] - q[1] * r[0], r[0] * p[1] - r[1] * p[0], p[0] * q[1] - p[1] * q[0]
    sizes = (abs(p[0]) + abs(p[1])) + (abs(q[0]) + abs(q[1])) + (abs(r[0]) + abs(r[1]))
    slack = fused(sizes, error, square)
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    return (u, v, w), slack, least, most, (least + slack >= slack - slack) | (most <= slack)


@njit(forceinline=True)
def are_sure(least, most, slack):  # type: ignore[no-untyped-def]
    """Mask of the triangles that a line surely crosses, by `areas_of`."""
    return (least > slack) | (slack - slack > most + slack)


@njit(forceinline=True)
def candidates(block, line, areas):  # type: ignore[no-untyped-def]
    """(bits of the triangles of a block that a line may cross, bits of those that it surely does).

    areas: address of memory of 7 vectors, written where there are any: twice the areas opposite the three corners, the
    corners' distances along the major axis, and the bound of the areas' error.
    """
    origin, shear, rows, (error, square), _, _ = line
    p = laid_corner(block, origin, shear, rows)
    q = laid_corner(block + 3 * _ROW, origin, shear, rows)
    r = laid_corner(block + 6 * _ROW, origin, shear, rows)
    (u, v, w), slack, least, most, some = areas_of(p, q, r, error, square)
    maybe = bits_of(some)
    if maybe == 0:
        return maybe, maybe
    store(u, areas)
    store(v, areas + _VECTOR)
    store(w, areas + 2 * _VECTOR)
    store(p[2], areas + 3 * _VECTOR)
    store(q[2], areas + 4 * _VECTOR)
    store(r[2], areas + 5 * _VECTOR)
    store(slack, areas + 6 * _VECTOR)
    return maybe, bits_of(are_sure(least, most, slack))


@njit(forceinline=True)
def sure_crossing(areas, k, line, tnear, tfar):  # type: ignore[no-untyped-def]
    """(sign, t, error, u, v) as `crossing`, of a triangle that the line surely crosses; sign 2: `crossing` has to
    decide."""
    at = doubles_at(areas + 8 * k)
    u, v, w, slack = at[0], at[BLOCK], at[2 * BLOCK], at[6 * BLOCK]
    a, b, c = at[3 * BLOCK], at[4 * BLOCK], at[5 * BLOCK]
    inverse_z = line[5]
    whole = u + v + w
    if not slack < PRECISE * abs(whole):
        return 2, 0.0, 0.0, 0.0, 0.0
    inverse = 1.0 / whole
    t = (u * a + v * b + w * c) * inverse * inverse_z
    error = error_of(slack * abs(inverse), a, b, c)
    if not (abs(t - tnear) > error and abs(t - tfar) > error):
        return 2, 0.0, 0.0, 0.0, 0.0
    if not tnear <= t < tfar:
        return 0, 0.0, 0.0, 0.0, 0.0
    return (1 if (whole > 0.0) == (inverse_z > 0.0) else -1), t, error, v * inverse, w * inverse


@njit(forceinline=True)
def error_of(share, a, b, c):  # type: ignore[no-untyped-def]
    """Largest error of the parameter of a crossing. share: of the areas' errors and their sum. a, b, c: distances of
    the corners along the major axis, of which the parameter is a mean, by the areas, or less.

    Weights are off by 6 shares together, which moves the mean by as large a part of the corners' range.
    """
    farthest = max(abs(a), abs(b), abs(c))
    return 16.0 * share * (max(a, b, c) - min(a, b, c)) + 16.0 * UNIT * farthest


@njit(forceinline=True)
def _point(place, k):  # type: ignore[no-untyped-def]
    """A corner of the k-th triangle of a block, from the address of the corner's rows."""
    at = place + 4 * k
    return np.float64(float_at(at)), np.float64(float_at(at + _ROW)), np.float64(float_at(at + 2 * _ROW))


@njit(forceinline=True)
def minus(a, b):  # type: ignore[no-untyped-def]
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(forceinline=True)
def cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def _sum(a):  # type: ignore[no-untyped-def]
    return abs(a[0]) + abs(a[1]) + abs(a[2])


_PLANE_ROUNDINGS = 32.0
"""Largest error of a volume, in roundings of the product of its three lengths (sums of components); there are 12."""


@out_of_line
def crossing(block, k, o, d, tnear, tfar, major, exact, touches):  # type: ignore[no-untyped-def]
    """(sign, t, error, u, v) of the crossing of a ray and the k-th triangle of the block at an address, tnear <= t <
    tfar.

    error: that of t at most. sign: of the triangle's normal along d; 0: no crossing, and the rest is undefined.
    u, v: weights of the second and the third corner. exact: address of `PARTS` float64. touches: whether a ray that
    meets an edge or a corner alone crosses, too.
    """
    a, b, c = _point(block, k), _point(block + 3 * _ROW, k), _point(block + 6 * _ROW, k)
    e, f, g = minus(b, a), minus(c, a), minus(a, o)
    normal = cross(e, f)
    facing, ahead = dot(normal, d), dot(normal, g)
    area = _PLANE_ROUNDINGS * UNIT * _sum(e) * _sum(f)
    is_flat = not abs(facing) > area * _sum(d)
    sign = touching_sign(o, d, a, b, c, exact) if touches else crossing_sign(o, d, a, b, c, major, exact)
    if sign == 0:
        return 0, 0.0, 0.0, 0.0, 0.0
    to_near, to_far = ahead - tnear * facing, ahead - tfar * facing
    if abs(to_near) > area * (_sum(g) + tnear * _sum(d)):
        if (to_near > 0.0) != (sign > 0):
            return 0, 0.0, 0.0, 0.0, 0.0
    elif plane_sign(o, d, a, b, c, tnear, exact) == -sign:
        return 0, 0.0, 0.0, 0.0, 0.0
    if tfar < np.inf:
        if abs(to_far) > area * (_sum(g) + tfar * _sum(d)):
            if (to_far > 0.0) == (sign > 0):
                return 0, 0.0, 0.0, 0.0, 0.0
        elif plane_sign(o, d, a, b, c, tfar, exact) != -sign:
            return 0, 0.0, 0.0, 0.0, 0.0
    t = plane_parameter(o, d, a, b, c, exact)
    if is_flat:  # seen all but edge-on
        return sign, t, _EXACT * abs(t), 1.0 / 3.0, 1.0 / 3.0
    inverse = 1.0 / facing
    around = cross(d, g)
    u, v = -dot(around, f) * inverse, dot(around, e) * inverse
    return sign, t, _EXACT * abs(t), min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)


_EXACT = 2.0 * UNIT
"""Largest error of a parameter that was computed without rounding but once."""


@njit(forceinline=True)
def crossing_of(block, k, is_sure, line, areas, ray, ends, exact, touches):  # type: ignore[no-untyped-def]
    """`crossing` of a candidate, in float64 where that tells. is_sure: by `candidates`. ray, ends: (o, d), (tnear,
    tfar)."""
    sign, t, error, u, v = 2, 0.0, 0.0, 0.0, 0.0
    if is_sure:
        sign, t, error, u, v = sure_crossing(areas, k, line, ends[0], ends[1])
    if sign == 2:
        sign, t, error, u, v = crossing(block, k, ray[0], ray[1], ends[0], ends[1], line[4], exact, touches)
    return sign, t, error, u, v


@out_of_line
def parameter(block, k, o, d, exact):  # type: ignore[no-untyped-def]
    """t of a triangle that a ray crosses, right to a unit of float64."""
    a, b, c = _point(block, k), _point(block + 3 * _ROW, k), _point(block + 6 * _ROW, k)
    return plane_parameter(o, d, a, b, c, exact)


@out_of_line
def is_before(block, k, other, m, o, d, exact):  # type: ignore[no-untyped-def]
    """Whether a ray meets the k-th triangle of a block before the m-th of another, both of which it crosses; where it
    meets them at one place, whether the former has the lower prim_id."""
    a, b, c = _point(block, k), _point(block + 3 * _ROW, k), _point(block + 6 * _ROW, k)
    p, q, r = _point(other, m), _point(other + 3 * _ROW, m), _point(other + 6 * _ROW, m)
    found = plane_order(o, d, a, b, c, p, q, r, exact)
    return found < 0 or (found == 0 and prim_id_of(block, k) < prim_id_of(other, m))


@njit(forceinline=True)
def prim_id_of(block, k):  # type: ignore[no-untyped-def]
    """The prim_id of the k-th triangle of a block."""
    return uint32_at(block + IDS + 4 * k)
