"""Crossings of one ray and the triangles of a tree: each exactly once.

Triangles are tested in float64, four at a time, with a bound of the error; where
that leaves a doubt `atra.exact.lines_kernels` decides.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at, uint32_at
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, repeated, size, smaller, widened
from atra.exact.lines_kernels import UNIT, crossing_sign, major_axis, plane_sign, touching_sign
from atra.trees.layout import BLOCK, IDS

_ZERO = np.float32(0.0)

_ROW = 4 * BLOCK
"""Bytes of a block's row: one coordinate of one corner of each triangle."""

_VECTOR = 8 * BLOCK
"""Bytes of a vector of float64, one of each triangle."""

AREAS = 7 * BLOCK
"""Numbers that `candidates` writes."""

_PRECISE = 2.0**-34
"""Share of a triangle's area up to which its error leaves t precise; t's own error is then a smaller share of the
mesh's distance."""

_ROUNDINGS = 16.0
"""Largest error of a sheared corner, in roundings of the largest distance to the mesh; there are 6."""


@njit(forceinline=True)
def scaled_ray(rays, number):  # type: ignore[no-untyped-def]
    """(o, d, tnear, tfar, scale) of a ray in float64, its direction brought to a largest component of 1 to 2 by the
    power of two `scale`; parameters times `scale` are those of the ray as given."""
    o = np.float64(rays.origins[number, 0]), np.float64(rays.origins[number, 1]), np.float64(rays.origins[number, 2])
    x = np.float64(rays.directions[number, 0])
    y = np.float64(rays.directions[number, 1])
    z = np.float64(rays.directions[number, 2])
    largest = np.float64(max(abs(x), abs(y), abs(z)))
    bits = largest.view(np.int64) & 0x7FF0000000000000
    scale = np.int64(0x7FE0000000000000 - bits).view(np.float64)
    length = np.int64(bits).view(np.float64)
    return (
        o, (x * scale, y * scale, z * scale), np.float64(rays.tnear[number]) * length,
        np.float64(rays.tfar[number]) * length, scale,
    )  # fmt: skip


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
    error = _ROUNDINGS * UNIT * reach
    return (
        (repeated(ox, BLOCK), repeated(oy, BLOCK), repeated(oz, BLOCK)),
        (repeated(-dx / dz, BLOCK), repeated(-dy / dz, BLOCK)),
        (one * _ROW, other * _ROW, major * _ROW),
        (repeated(error, BLOCK), repeated(error * error, BLOCK)),
        major,
        (1.0 / dz, reach),
    )  # fmt: skip


@njit(forceinline=True)
def _corner(place, line):  # type: ignore[no-untyped-def]
    """A corner of four triangles, from an address, laid along the ray onto the plane across its major axis."""
    (ox, oy, oz), (sx, sy), (row_x, row_y, row_z), _, _, _ = line
    z = widened(load(place + row_z, _ZERO, BLOCK)) - oz
    x = fused(sx, z, widened(load(place + row_x, _ZERO, BLOCK)) - ox)
    return x, fused(sy, z, widened(load(place + row_y, _ZERO, BLOCK)) - oy), z


@njit(forceinline=True)
def candidates(block, line, areas):  # type: ignore[no-untyped-def]
    """(bits of the triangles of a block that a line may cross, bits of those that it surely does).

    areas: address of memory of 7 vectors, written where there are any: twice the areas opposite the three corners, the
    corners' distances along the major axis, and the bound of the areas' error.
    """
    px, py, pz = _corner(block, line)
    qx, qy, qz = _corner(block + 3 * _ROW, line)
    rx, ry, rz = _corner(block + 6 * _ROW, line)
    u, v, w = qx * ry - qy * rx, rx * py - ry * px, px * qy - py * qx
    _, _, _, (error, square), _, _ = line
    sizes = (size(px) + size(py)) + (size(qx) + size(qy)) + (size(rx) + size(ry))
    slack = fused(sizes, error, square)
    none = slack - slack
    least, most = smaller(smaller(u, v), w), larger(larger(u, v), w)
    maybe = bits_of((least + slack >= none) | (most <= slack))
    if maybe == 0:
        return maybe, maybe
    store(u, areas)
    store(v, areas + _VECTOR)
    store(w, areas + 2 * _VECTOR)
    store(pz, areas + 3 * _VECTOR)
    store(qz, areas + 4 * _VECTOR)
    store(rz, areas + 5 * _VECTOR)
    store(slack, areas + 6 * _VECTOR)
    return maybe, bits_of((least > slack) | (none > most + slack))


@njit(forceinline=True)
def sure_crossing(areas, k, line, tnear, tfar):  # type: ignore[no-untyped-def]
    """(sign, t, u, v) as `crossing`, of a triangle that the line surely crosses; sign 2: `crossing` has to decide."""
    at = doubles_at(areas + 8 * k)
    u, v, w, slack = at[0], at[BLOCK], at[2 * BLOCK], at[6 * BLOCK]
    a, b, c = at[3 * BLOCK], at[4 * BLOCK], at[5 * BLOCK]
    inverse_z, reach = line[5]
    whole = u + v + w
    if not slack < _PRECISE * abs(whole):
        return 2, 0.0, 0.0, 0.0
    inverse = 1.0 / whole
    t = (u * a + v * b + w * c) * inverse * inverse_z
    error = _PRECISE * (4.0 * reach + abs(t))
    if not (abs(t - tnear) > error and abs(t - tfar) > error):
        return 2, 0.0, 0.0, 0.0
    if not tnear <= t < tfar:
        return 0, 0.0, 0.0, 0.0
    return (1 if (whole > 0.0) == (inverse_z > 0.0) else -1), t, v * inverse, w * inverse


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


@njit
def crossing(block, k, o, d, tnear, tfar, major, exact, touches):  # type: ignore[no-untyped-def]
    """(sign, t, u, v) of the crossing of a ray and the k-th triangle of the block at an address, tnear <= t < tfar.

    sign: of the triangle's normal along d; 0: no crossing, and the rest is undefined.
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
        return 0, 0.0, 0.0, 0.0
    to_near, to_far = ahead - tnear * facing, ahead - tfar * facing
    if abs(to_near) > area * (_sum(g) + tnear * _sum(d)):
        if (to_near > 0.0) != (sign > 0):
            return 0, 0.0, 0.0, 0.0
    elif plane_sign(o, d, a, b, c, tnear, exact) == -sign:
        return 0, 0.0, 0.0, 0.0
    if tfar < np.inf:
        if abs(to_far) > area * (_sum(g) + tfar * _sum(d)):
            if (to_far > 0.0) == (sign > 0):
                return 0, 0.0, 0.0, 0.0
        elif plane_sign(o, d, a, b, c, tfar, exact) != -sign:
            return 0, 0.0, 0.0, 0.0
    if is_flat:  # seen all but edge-on: t lies between those of the corners
        square = dot(d, d)
        first, second, third = dot(g, d) / square, dot(minus(b, o), d) / square, dot(minus(c, o), d) / square
        t = (first + second + third) / 3.0
        if facing != 0.0:
            t = min(max(ahead / facing, min(first, second, third)), max(first, second, third))
        return sign, min(max(t, tnear), tfar), 1.0 / 3.0, 1.0 / 3.0
    inverse = 1.0 / facing
    around = cross(d, g)
    u, v = -dot(around, f) * inverse, dot(around, e) * inverse
    return sign, min(max(ahead * inverse, tnear), tfar), min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)


@njit(forceinline=True)
def prim_id_of(block, k):  # type: ignore[no-untyped-def]
    """The prim_id of the k-th triangle of a block."""
    return uint32_at(block + IDS + 4 * k)
