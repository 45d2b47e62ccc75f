"""Rays and the boxes of a node's children, in float32: no box is lost that a ray meets.

The ray starts again where it comes near the mesh, and each box is enlarged by more than all roundings. Several rays
that head for one octant enter a box where the intervals that hold their numbers may, as float32 rounds monotonically.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.memory import load
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, larger, smaller, splat
from atra.exact.sums_kernels import UNIT
from atra.trees.wide import CHILDREN, HIGH

_ZERO = np.float32(0.0)

BOX_MARGIN = 2.0**-20
"""By which share of the mesh's distance from the world's origin plus its size boxes are enlarged; float32 rounds the
start of the ray, and four operations of a box test, by a third of that together."""

FAR_MARGIN = 2.0**-48
"""By which share of the ray's way to the mesh boxes are enlarged; float64 rounds the new start by an eighth of that."""

SMALLEST_COMPONENT = 1e-18
"""Smaller components of a direction have this reciprocal; within the mesh's size that moves a ray less than margins."""

PADDING = 1.01
"""Factor on the sphere around the mesh, so that rounding moves no ray out of it."""


@njit(forceinline=True)
def start_of(o, d, tnear, tfar, sphere):  # type: ignore[no-untyped-def]
    """(whether the ray may meet the mesh, s): it starts again at o + s d, beyond `tnear` where the mesh is far.

    d: its largest component is from 1 to 2 in size. sphere: middle of the mesh's box and half its diagonal. Where the
    ray starts near by, it is neither moved nor left out: its start is at most four radii away, as margins have it.
    """
    cx, cy, cz, radius = sphere
    x, y, z = cx - o[0], cy - o[1], cz - o[2]
    if max(abs(x), abs(y), abs(z)) <= 3.0 * radius and tnear <= 0.5 * radius:
        return tnear < tfar, tnear
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    middle = (x * d[0] + y * d[1] + z * d[2]) / square
    padded = PADDING * radius + 64.0 * UNIT * (abs(x) + abs(y) + abs(z))
    reach = padded / np.sqrt(square)
    s = max(tnear, middle - reach)
    x, y, z = x - s * d[0], y - s * d[1], z - s * d[2]
    is_near = s <= middle + reach and max(abs(x), abs(y), abs(z)) <= 1.5 * padded
    return is_near and tnear < tfar and s < tfar, s


@njit(forceinline=True)
def _reciprocal(component):  # type: ignore[no-untyped-def]
    """1 / component, of one sign for all components from 0 up; it never rises with them."""
    if abs(component) >= SMALLEST_COMPONENT:
        return 1.0 / component
    return 1.0 / SMALLEST_COMPONENT if component >= 0.0 else -1.0 / SMALLEST_COMPONENT


@njit(forceinline=True)
def margin_of(o, sphere):  # type: ignore[no-untyped-def]
    """By how much boxes are enlarged for a ray."""
    cx, cy, cz, radius = sphere
    way = max(abs(cx - o[0]), abs(cy - o[1]), abs(cz - o[2]))
    return (max(abs(cx), abs(cy), abs(cz)) + 4.0 * radius) * BOX_MARGIN + way * FAR_MARGIN


@njit(forceinline=True)
def ahead_of(s, tfar, margin):  # type: ignore[no-untyped-def]
    """Where a ray that starts again at s enters boxes at the latest, float32."""
    return np.float32((tfar - s) * (1.0 + BOX_MARGIN) + margin)


@njit(forceinline=True)
def slabs_of(low, high, one, other, is_down, margin, axis):  # type: ignore[no-untyped-def]
    """What box tests need of an axis, along which rays head the same way: where they start as seen from near and far
    sides of boxes, reciprocals of directions, and where the sides lie in a node.

    low, high: of where rays start; one, other: of the reciprocals. margin: by which boxes are enlarged.
    """
    near, far = (low - margin, high + margin) if is_down else (high + margin, low - margin)
    row = axis * 4 * CHILDREN
    return (
        splat(np.float32(near), CHILDREN), splat(np.float32(far), CHILDREN),
        splat(one, CHILDREN), splat(other, CHILDREN),
        HIGH + row if is_down else row, row if is_down else HIGH + row,
    )  # fmt: skip


@njit(forceinline=True)
def query_of(x, y, z, ahead, margin):  # type: ignore[no-untyped-def]
    """What box tests need of rays: the slabs of each axis, and where they start and end."""
    return x, y, z, splat(np.float32(-margin), CHILDREN), splat(ahead, CHILDREN)


@njit(forceinline=True)
def query_alone(o, d, s, ahead, margin):  # type: ignore[no-untyped-def]
    """`query_of` one ray, which starts again at o + s d."""
    x, y, z = np.float32(o[0] + s * d[0]), np.float32(o[1] + s * d[1]), np.float32(o[2] + s * d[2])
    u, v, w = np.float32(_reciprocal(d[0])), np.float32(_reciprocal(d[1])), np.float32(_reciprocal(d[2]))
    by = np.float32(margin)
    return query_of(
        slabs_of(x, x, u, u, u < 0, by, 0), slabs_of(y, y, v, v, v < 0, by, 1), slabs_of(z, z, w, w, w < 0, by, 2),
        ahead, margin,
    )  # fmt: skip


@njit(forceinline=True)
def shortened(query, ahead):  # type: ignore[no-untyped-def]
    """The query of rays that end at `ahead`."""
    return query[0], query[1], query[2], query[3], splat(ahead, CHILDREN)


@njit(forceinline=True)
def _entered(query, near, far):  # type: ignore[no-untyped-def]
    # The second argument is kept where a number is NaN: unused children stay NaN and are not entered.
    first = larger(query[3], larger(near[1], larger(near[2], near[0])))
    last = smaller(query[4], smaller(far[1], smaller(far[2], far[0])))
    return bits_of(first <= last), first


@njit(forceinline=True)
def _to_near(node, slabs):  # type: ignore[no-untyped-def]
    return load(node + slabs[4], _ZERO, CHILDREN) - slabs[0]


@njit(forceinline=True)
def _to_far(node, slabs):  # type: ignore[no-untyped-def]
    return load(node + slabs[5], _ZERO, CHILDREN) - slabs[1]


@njit(forceinline=True)
def enter_alone(node, query):  # type: ignore[no-untyped-def]
    """(bits of the children that a ray may enter, where at the earliest), of the node at an address."""
    x, y, z, _, _ = query
    near = _to_near(node, x) * x[2], _to_near(node, y) * y[2], _to_near(node, z) * z[2]
    far = _to_far(node, x) * x[2], _to_far(node, y) * y[2], _to_far(node, z) * z[2]
    return _entered(query, near, far)


@njit(forceinline=True)
def _entry(node, slabs):  # type: ignore[no-untyped-def]
    way = _to_near(node, slabs)
    return smaller(way * slabs[2], way * slabs[3])


@njit(forceinline=True)
def _exit(node, slabs):  # type: ignore[no-untyped-def]
    way = _to_far(node, slabs)
    return larger(way * slabs[2], way * slabs[3])


@njit(forceinline=True)
def enter_together(node, query):  # type: ignore[no-untyped-def]
    """The same of several rays: where any of them enters a child at the earliest, and leaves it at the latest."""
    x, y, z, _, _ = query
    near = _entry(node, x), _entry(node, y), _entry(node, z)
    return _entered(query, near, (_exit(node, x), _exit(node, y), _exit(node, z)))
