"""Crossings of one ray and the triangles of a tree of eight children per node: each exactly once.

Boxes are tested in float32 and never lose a triangle: the ray starts anew where it comes near the mesh, and each box is
enlarged by more than all roundings. Triangles are tested in float64, four at a time, with a bound of the error; where
that leaves a doubt `atra.exact.lines_kernels` decides.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at, uint32_at
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, repeated, size, smaller, widened
from atra.exact.lines_kernels import UNIT, crossing_sign, major_axis, plane_sign
from atra.trees.layout import BLOCK, IDS
from atra.trees.wide import CHILDREN, HIGH

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

_BOX_MARGIN = 2.0**-20
"""By which share of the mesh's distance from the world's origin plus its size boxes are enlarged; float32 rounds the
start of the ray, and three operations of a box test, by a quarter of that together."""

_FAR_MARGIN = 2.0**-48
"""By which share of the ray's way to the mesh boxes are enlarged; float64 rounds the new start by an eighth of that."""

_SMALLEST_COMPONENT = 1e-18
"""Smaller components of a direction have this reciprocal; within the mesh's size that moves a ray less than margins."""

_PADDING = 1.01
"""Factor on the sphere around the mesh, so that rounding moves no ray out of it."""


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
def start_of(o, d, tnear, sphere):  # type: ignore[no-untyped-def]
    """(whether the ray comes near the mesh, s): it starts anew at o + s d, beyond `tnear` where the mesh is far.

    sphere: middle of the mesh's box and half its diagonal.
    """
    cx, cy, cz, radius = sphere
    x, y, z = cx - o[0], cy - o[1], cz - o[2]
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    middle = (x * d[0] + y * d[1] + z * d[2]) / square
    padded = _PADDING * radius + 64.0 * UNIT * (abs(x) + abs(y) + abs(z))
    reach = padded / np.sqrt(square)
    s = max(tnear, middle - reach)
    x, y, z = x - s * d[0], y - s * d[1], z - s * d[2]
    return s <= middle + reach and max(abs(x), abs(y), abs(z)) <= 1.5 * padded, s


@njit(forceinline=True)
def _reciprocal(component):  # type: ignore[no-untyped-def]
    if abs(component) >= _SMALLEST_COMPONENT:
        return 1.0 / component
    return 1.0 / _SMALLEST_COMPONENT if component >= 0.0 else -1.0 / _SMALLEST_COMPONENT


@njit(forceinline=True)
def box_ray(o, d, s, tfar, sphere):  # type: ignore[no-untyped-def]
    """What box tests need of a ray that starts anew at o + s d: vectors of `CHILDREN` float32, and where the near and
    the far sides of boxes lie in a node."""
    cx, cy, cz, radius = sphere
    way = max(abs(cx - o[0]), abs(cy - o[1]), abs(cz - o[2]))
    margin = (max(abs(cx), abs(cy), abs(cz)) + 4.0 * radius) * _BOX_MARGIN + way * _FAR_MARGIN
    row = 4 * CHILDREN
    ix, iy, iz = np.float32(_reciprocal(d[0])), np.float32(_reciprocal(d[1])), np.float32(_reciprocal(d[2]))
    mx, my, mz = np.float32(margin * abs(ix)), np.float32(margin * abs(iy)), np.float32(margin * abs(iz))
    ahead = (tfar - s) * (1.0 + _BOX_MARGIN) + margin
    return (
        (
            repeated(np.float32(o[0] + s * d[0]), CHILDREN), repeated(np.float32(o[1] + s * d[1]), CHILDREN),
            repeated(np.float32(o[2] + s * d[2]), CHILDREN),
        ),
        (repeated(ix, CHILDREN), repeated(iy, CHILDREN), repeated(iz, CHILDREN)),
        (repeated(mx, CHILDREN), repeated(my, CHILDREN), repeated(mz, CHILDREN)),
        (repeated(-mx, CHILDREN), repeated(-my, CHILDREN), repeated(-mz, CHILDREN)),
        (repeated(np.float32(-margin), CHILDREN), repeated(np.float32(ahead), CHILDREN)),
        (
            0 if ix > 0 else HIGH, row if iy > 0 else HIGH + row, 2 * row if iz > 0 else HIGH + 2 * row,
            HIGH if ix > 0 else 0, HIGH + row if iy > 0 else row, HIGH + 2 * row if iz > 0 else 2 * row,
        ),
    )  # fmt: skip


@njit(forceinline=True)
def entered(node, ray):  # type: ignore[no-untyped-def]
    """Bits of the children that a ray may meet, of the node at an address. ray: from `box_ray`."""
    (x, y, z), (ix, iy, iz), (mx, my, mz), (nx, ny, nz), (start, end), places = ray
    first_x = fused(load(node + places[0], _ZERO, CHILDREN) - x, ix, nx)
    first_y = fused(load(node + places[1], _ZERO, CHILDREN) - y, iy, ny)
    first_z = fused(load(node + places[2], _ZERO, CHILDREN) - z, iz, nz)
    last_x = fused(load(node + places[3], _ZERO, CHILDREN) - x, ix, mx)
    last_y = fused(load(node + places[4], _ZERO, CHILDREN) - y, iy, my)
    last_z = fused(load(node + places[5], _ZERO, CHILDREN) - z, iz, mz)
    # The second argument is kept where a number is NaN: unused children stay NaN and are not entered.
    first = larger(start, larger(first_y, larger(first_z, first_x)))
    last = smaller(end, smaller(last_y, smaller(last_z, last_x)))
    return bits_of(first <= last)


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
def crossing(block, k, o, d, tnear, tfar, major, exact):  # type: ignore[no-untyped-def]
    """(sign, t, u, v) of the crossing of a ray and the k-th triangle of the block at an address, tnear <= t < tfar.

    sign: of the triangle's normal along d; 0: no crossing, and the rest is undefined.
    u, v: weights of the second and the third corner. exact: address of `PARTS` float64.
    """
    a, b, c = _point(block, k), _point(block + 3 * _ROW, k), _point(block + 6 * _ROW, k)
    e, f, g = minus(b, a), minus(c, a), minus(a, o)
    normal = cross(e, f)
    facing, ahead = dot(normal, d), dot(normal, g)
    area = _PLANE_ROUNDINGS * UNIT * _sum(e) * _sum(f)
    is_flat = not abs(facing) > area * _sum(d)
    sign = crossing_sign(o, d, a, b, c, major, exact)
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
