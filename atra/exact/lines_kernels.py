"""Exact decisions between a ray and a triangle: whether the ray crosses it, and on which side of t = s.

The side of an edge from p to q that a ray (o, d) passes on is the sign of d . ((p - o) x (q - o)), a sum of products
that is added without error (`atra.exact.sums_kernels`). A ray through an edge counts as moved by (e, e^2) along the two
axes after its major one, with an infinitely small e > 0. So it crosses exactly the triangles that some nearby ray
crosses: through an edge or corner of a closed mesh as often as it should, and a triangle seen edge-on never.
Source: H. Edelsbrunner, E. P. Mücke, "Simulation of simplicity", 1990.
"""

from __future__ import annotations

from atra.compiled.memory import doubles_at
from atra.compiled.store import njit
from atra.compiled.vectors import multiply_add
from atra.exact.sums_kernels import add_product, add_triple, out_of_line, sign_of, value_of

PARTS = 512
"""Parts of exact sums; callers provide the address of memory for as many float64."""

_SUM_BYTES = 8 * 64
"""Memory of one of several sums; no sum has more parts, as they do not overlap and float64 has 2,100 bits."""


@out_of_line
def _add_volume(sum_, count, a, b, c):  # type: ignore[no-untyped-def]
    """Add a . (b x c)."""
    for k in range(3):
        m, n = (k + 1) % 3, (k + 2) % 3
        count = add_triple(sum_, count, a[k], b[m], c[n])
        count = add_triple(sum_, count, -a[k], b[n], c[m])
    return count


@out_of_line
def _side_or_through(o, d, p, q, exact):  # type: ignore[no-untyped-def]
    """The side of the edge from p to q that the ray passes on, 1 or -1; 0 for a ray through the edge's line."""
    sum_ = doubles_at(exact)
    count = _add_volume(sum_, 0, d, p, q)
    count = _add_volume(sum_, count, d, o, p)
    count = _add_volume(sum_, count, d, q, o)
    return sign_of(sum_, count)


@out_of_line
def _side(o, d, p, q, major, exact):  # type: ignore[no-untyped-def]
    """The same of the moved ray; 0 for an edge along the ray."""
    sum_ = doubles_at(exact)
    found = _side_or_through(o, d, p, q, exact)
    for step in (1, 2):
        if found == 0:
            k = (major + step) % 3
            m, n = (k + 1) % 3, (k + 2) % 3
            count = add_product(sum_, 0, d[m], q[n])
            count = add_product(sum_, count, -d[m], p[n])
            count = add_product(sum_, count, -d[n], q[m])
            count = add_product(sum_, count, d[n], p[m])
            found = sign_of(sum_, count)
    return found


@out_of_line
def crossing_sign(o, d, a, b, c, major, exact):  # type: ignore[no-untyped-def]
    """1 or -1 where a line crosses a triangle, the sign of its normal (b - a) x (c - a) along d; 0 where it does not.

    o, d, a, b, c: origin, direction and corners, three float64 each. major: axis of the largest component of d.
    exact: address of PARTS float64.
    """
    found = _side(o, d, a, b, major, exact)
    if found == 0 or _side(o, d, b, c, major, exact) != found or _side(o, d, c, a, major, exact) != found:
        return 0
    return found


@out_of_line
def touching_sign(o, d, a, b, c, exact):  # type: ignore[no-untyped-def]
    """As `crossing_sign`, of the ray where it is: also where it meets the triangle in an edge or a corner."""
    one, two = _side_or_through(o, d, a, b, exact), _side_or_through(o, d, b, c, exact)
    three = _side_or_through(o, d, c, a, exact)
    least, most = min(one, two, three), max(one, two, three)
    return 0 if least < 0 < most else least + most if least != most else least


@out_of_line
def plane_sign(o, d, a, b, c, s, exact):  # type: ignore[no-untyped-def]
    """The sign, -1, 0 or 1, of ((b - a) x (c - a)) . (a - o - s d): of t - s, times that of the normal along d, where
    t is the parameter at which the ray meets the plane. Arguments as for `crossing_sign`."""
    sum_ = doubles_at(exact)
    count = _add_volume(sum_, 0, a, b, c)
    for part in ((b, c), (c, a), (a, b)):
        count = _add_volume(sum_, count, (-o[0], -o[1], -o[2]), part[0], part[1])
        if s != 0.0:
            for k in range(3):
                m, n = (k + 1) % 3, (k + 2) % 3
                count = _add_scaled(sum_, count, -s, d[k], part[0][m], part[1][n])
                count = _add_scaled(sum_, count, s, d[k], part[0][n], part[1][m])
    return sign_of(sum_, count)


@out_of_line
def _add_scaled(sum_, count, s, a, b, c):  # type: ignore[no-untyped-def]
    """Add s a b c."""
    high = s * a
    low = multiply_add(s, a, -high)
    if low != 0.0:
        count = add_triple(sum_, count, b, c, low)
    return add_triple(sum_, count, b, c, high)


@njit(forceinline=True)
def _minus(a, b):  # type: ignore[no-untyped-def]
    """(a - b, whether float64 holds it without rounding)."""
    found, is_exact = (a[0] - b[0], a[1] - b[1], a[2] - b[2]), True
    for k in range(3):
        other = found[k] - a[k]
        is_exact = is_exact and (a[k] - (found[k] - other)) - (b[k] + other) == 0.0
    return found, is_exact


@out_of_line
def _add_plane(ahead, facing, o, d, a, b, c):  # type: ignore[no-untyped-def]
    """Write ((b - a) x (c - a)) . (a - o) and ((b - a) x (c - a)) . d as exact sums; returns the counts of their parts.
    The ray meets the plane at the parameter that is their quotient."""
    e, is_e = _minus(b, a)
    f, is_f = _minus(c, a)
    g, is_g = _minus(a, o)
    if is_e and is_f and is_g:
        return _add_volume(ahead, 0, g, e, f), _add_volume(facing, 0, d, e, f)
    many, count = _add_volume(ahead, 0, a, b, c), 0
    for part in ((b, c), (c, a), (a, b)):
        many = _add_volume(ahead, many, (-o[0], -o[1], -o[2]), part[0], part[1])
        count = _add_volume(facing, count, d, part[0], part[1])
    return many, count


@out_of_line
def plane_parameter(o, d, a, b, c, exact):  # type: ignore[no-untyped-def]
    """The parameter at which a ray meets the plane of a triangle that it crosses, right to a unit of float64. Arguments
    as for `crossing_sign`."""
    ahead, facing = doubles_at(exact), doubles_at(exact + _SUM_BYTES)
    many, count = _add_plane(ahead, facing, o, d, a, b, c)
    below = value_of(facing, count)
    t = value_of(ahead, many) / below
    for k in range(count):
        many = add_product(ahead, many, facing[k], -t)
    return t + value_of(ahead, many) / below


@out_of_line
def plane_order(o, d, a, b, c, p, q, r, exact):  # type: ignore[no-untyped-def]
    """The sign, -1, 0 or 1, of t - s, the parameters at which a ray meets the planes of triangles a, b, c and p, q, r,
    both of which it crosses."""
    ahead, facing = doubles_at(exact), doubles_at(exact + _SUM_BYTES)
    ahead_2, facing_2 = doubles_at(exact + 2 * _SUM_BYTES), doubles_at(exact + 3 * _SUM_BYTES)
    many, count = _add_plane(ahead, facing, o, d, a, b, c)
    many_2, count_2 = _add_plane(ahead_2, facing_2, o, d, p, q, r)
    sum_, used = doubles_at(exact + 4 * _SUM_BYTES), 0
    for k in range(many):
        for m in range(count_2):
            used = add_product(sum_, used, ahead[k], facing_2[m])
    for k in range(many_2):
        for m in range(count):
            used = add_product(sum_, used, -ahead_2[k], facing[m])
    return sign_of(sum_, used) * sign_of(facing, count) * sign_of(facing_2, count_2)


@njit(forceinline=True)
def major_axis(x, y, z):  # type: ignore[no-untyped-def]
    """The axis of the largest of three components in size."""
    a, b, c = abs(x), abs(y), abs(z)
    return 0 if a >= b and a >= c else 1 if b >= c else 2
