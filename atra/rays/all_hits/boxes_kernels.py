"""Rays and the boxes of a tree of eight children per node, in float32: no box is lost that a ray meets.

The ray starts anew where it comes near the mesh, and each box is enlarged by more than all roundings. Groups of rays
follow each other through the tree: a group visits every node that one of its rays may enter, as the numbers of its rays
lie in intervals and float32 rounds monotonically. So its rays need only be tested with the boxes of the nodes found,
which have leaves.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import load, prefetch, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, lane, larger, smaller, splat
from atra.exact.sums_kernels import UNIT
from atra.rays.rays_kernels import scaled_ray
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS, CHILDREN, FIRSTS, HIGH, WIDE_BYTES

_ZERO = np.float32(0.0)

BOX_MARGIN = 2.0**-20
"""By which share of the mesh's distance from the world's origin plus its size boxes are enlarged; float32 rounds the
start of the ray, and three operations of a box test, by a quarter of that together."""

FAR_MARGIN = 2.0**-48
"""By which share of the ray's way to the mesh boxes are enlarged; float64 rounds the new start by an eighth of that."""

SMALLEST_COMPONENT = 1e-18
"""Smaller components of a direction have this reciprocal; within the mesh's size that moves a ray less than margins."""

PADDING = 1.01
"""Factor on the sphere around the mesh, so that rounding moves no ray out of it."""


@njit(forceinline=True)
def start_of(o, d, tnear, sphere):  # type: ignore[no-untyped-def]
    """(whether the ray comes near the mesh, s): it starts anew at o + s d, beyond `tnear` where the mesh is far.

    d: its largest component is from 1 to 2 in size. sphere: middle of the mesh's box and half its diagonal. Where the
    ray starts near by, it is neither moved nor left out: its start is at most four radii away, as margins have it.
    """
    cx, cy, cz, radius = sphere
    x, y, z = cx - o[0], cy - o[1], cz - o[2]
    if max(abs(x), abs(y), abs(z)) <= 3.0 * radius and tnear <= 0.5 * radius:
        return True, tnear
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    middle = (x * d[0] + y * d[1] + z * d[2]) / square
    padded = PADDING * radius + 64.0 * UNIT * (abs(x) + abs(y) + abs(z))
    reach = padded / np.sqrt(square)
    s = max(tnear, middle - reach)
    x, y, z = x - s * d[0], y - s * d[1], z - s * d[2]
    return s <= middle + reach and max(abs(x), abs(y), abs(z)) <= 1.5 * padded, s


@njit(forceinline=True)
def reciprocal(component):  # type: ignore[no-untyped-def]
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
    """Where a ray that starts anew at s enters boxes at the latest."""
    return (tfar - s) * (1.0 + BOX_MARGIN) + margin


@njit(forceinline=True)
def box_ray(o, d, s, tfar, sphere):  # type: ignore[no-untyped-def]
    """What box tests need of a ray that starts anew at o + s d: vectors of `CHILDREN` float32, and where the near and
    the far sides of boxes lie in a node."""
    margin, row = margin_of(o, sphere), 4 * CHILDREN
    ix, iy, iz = np.float32(reciprocal(d[0])), np.float32(reciprocal(d[1])), np.float32(reciprocal(d[2]))
    mx, my, mz = np.float32(margin * abs(ix)), np.float32(margin * abs(iy)), np.float32(margin * abs(iz))
    ahead = ahead_of(s, tfar, margin)
    return (
        (
            splat(np.float32(o[0] + s * d[0]), CHILDREN), splat(np.float32(o[1] + s * d[1]), CHILDREN),
            splat(np.float32(o[2] + s * d[2]), CHILDREN),
        ),
        (splat(ix, CHILDREN), splat(iy, CHILDREN), splat(iz, CHILDREN)),
        (splat(mx, CHILDREN), splat(my, CHILDREN), splat(mz, CHILDREN)),
        (splat(-mx, CHILDREN), splat(-my, CHILDREN), splat(-mz, CHILDREN)),
        (splat(np.float32(-margin), CHILDREN), splat(np.float32(ahead), CHILDREN)),
        (
            0 if ix > 0 else HIGH, row if iy > 0 else HIGH + row, 2 * row if iz > 0 else HIGH + 2 * row,
            HIGH if ix > 0 else 0, HIGH + row if iy > 0 else row, HIGH + 2 * row if iz > 0 else 2 * row,
        ),
    )  # fmt: skip


@njit(forceinline=True)
def shortened(ray, s, t):  # type: ignore[no-untyped-def]
    """(the ray of box tests, made to end at t, where it enters boxes at the latest)."""
    origin, inverse, outer, inner, (start, _), places = ray
    ahead = np.float32((t - s) * (1.0 + BOX_MARGIN) - np.float64(lane(start, 0)))
    return (origin, inverse, outer, inner, (start, splat(ahead, CHILDREN)), places), ahead


@njit(forceinline=True)
def entered(node, ray):  # type: ignore[no-untyped-def]
    """Bits of the children that a ray may meet, of the node at an address. ray: from `box_ray`."""
    first, last = _interval(node, ray)
    return bits_of(first <= last)


@njit(forceinline=True)
def entered_at(node, ray, entries):  # type: ignore[no-untyped-def]
    """The same, and where the ray enters the children, at the earliest: float32 written to the address `entries`."""
    first, last = _interval(node, ray)
    store(first, entries)
    return bits_of(first <= last)


@njit(forceinline=True)
def _interval(node, ray):  # type: ignore[no-untyped-def]
    (x, y, z), (ix, iy, iz), (mx, my, mz), (nx, ny, nz), (start, end), places = ray
    first_x = fused(load(node + places[0], _ZERO, CHILDREN) - x, ix, nx)
    first_y = fused(load(node + places[1], _ZERO, CHILDREN) - y, iy, ny)
    first_z = fused(load(node + places[2], _ZERO, CHILDREN) - z, iz, nz)
    last_x = fused(load(node + places[3], _ZERO, CHILDREN) - x, ix, mx)
    last_y = fused(load(node + places[4], _ZERO, CHILDREN) - y, iy, my)
    last_z = fused(load(node + places[5], _ZERO, CHILDREN) - z, iz, mz)
    # The second argument is kept where a number is NaN: unused children stay NaN and are not entered.
    first = larger(start, larger(first_y, larger(first_z, first_x)))
    return first, smaller(end, smaller(last_y, smaller(last_z, last_x)))


@njit(forceinline=True)
def slabs_of(low, high, one, other, is_down, margin, axis):  # type: ignore[no-untyped-def]
    """What box tests of several rays need of an axis, all of which head the same way along it: where they start as seen
    from near and far sides of boxes, reciprocals of directions, and where the sides lie in a node.

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
def entry_of(node, slabs):  # type: ignore[no-untyped-def]
    start, _, one, other, place, _ = slabs
    way = load(node + place, _ZERO, CHILDREN) - start
    return smaller(way * one, way * other)


@njit(forceinline=True)
def exit_of(node, slabs):  # type: ignore[no-untyped-def]
    _, start, one, other, _, place = slabs
    way = load(node + place, _ZERO, CHILDREN) - start
    return larger(way * one, way * other)


@njit(forceinline=True)
def interval_in(node, start, end, x, y, z):  # type: ignore[no-untyped-def]
    """Where any of several rays enters the children of a node at the earliest, and leaves them at the latest."""
    near = larger(start, larger(entry_of(node, y), larger(entry_of(node, z), entry_of(node, x))))
    return near, smaller(end, smaller(exit_of(node, y), smaller(exit_of(node, z), exit_of(node, x))))


@njit(forceinline=True)
def child_node(tree, node, child):  # type: ignore[no-untyped-def]
    """The address of a child that is no leaf, which is prefetched. child: four times its number in the node."""
    to = tree.nodes + np.int64(int32_at(node + FIRSTS + child)) * WIDE_BYTES
    prefetch(to)
    prefetch(to + 64)
    prefetch(to + 128)
    prefetch(to + 192)
    return to


@njit(forceinline=True)
def first_block(tree, node, child):  # type: ignore[no-untyped-def]
    """The address of the first block of a child that is a leaf, which is prefetched."""
    to = tree.blocks + np.int64(int32_at(node + FIRSTS + child)) * BLOCK_BYTES
    prefetch(to)
    prefetch(to + 64)
    prefetch(to + 128)
    return to


GROUP = 16
"""Rays that follow each other at most."""

MOST_NODES = 128
"""Nodes with leaves that a group may find; rays of others go alone, as do those that head for several octants."""

_NEAR_BY = 1 / 16
"""How far apart rays of a group start at most, as a share of the mesh's radius; others go alone."""


@njit
def find_together(batch, first, last, tree, found):  # type: ignore[no-untyped-def]
    """The number of nodes with leaves that rays from `first` to `last` may enter, -1 where they had better go alone.

    Writes their addresses to `found.nodes`, and which children are leaves to `found.leaves`.
    """
    low_x = low_y = low_z = np.float32(np.inf)
    high_x = high_y = high_z = np.float32(-np.inf)
    least_x = least_y = least_z = np.inf
    most_x = most_y = most_z = -np.inf
    margin, ahead, count = 0.0, 0.0, 0
    for number in range(first, last):
        o, d, tnear, tfar, _ = scaled_ray(batch, number)
        is_near, s = start_of(o, d, tnear, tree.sphere)
        if not (is_near and tnear < tfar and s < tfar):
            continue
        count += 1
        own = margin_of(o, tree.sphere)
        margin, ahead = max(margin, own), max(ahead, ahead_of(s, tfar, own))
        x, y, z = np.float32(o[0] + s * d[0]), np.float32(o[1] + s * d[1]), np.float32(o[2] + s * d[2])
        low_x, low_y, low_z = min(low_x, x), min(low_y, y), min(low_z, z)
        high_x, high_y, high_z = max(high_x, x), max(high_y, y), max(high_z, z)
        least_x, least_y, least_z = min(least_x, d[0]), min(least_y, d[1]), min(least_z, d[2])
        most_x, most_y, most_z = max(most_x, d[0]), max(most_y, d[1]), max(most_z, d[2])
    if count == 0:
        return 0
    if least_x < 0.0 <= most_x or least_y < 0.0 <= most_y or least_z < 0.0 <= most_z:
        return -1
    if max(high_x - low_x, high_y - low_y, high_z - low_z) > _NEAR_BY * tree.sphere[3]:
        return -1
    margin_32 = np.float32(margin)
    x = slabs_of(low_x, high_x, _inverse(least_x), _inverse(most_x), least_x < 0.0, margin_32, 0)
    y = slabs_of(low_y, high_y, _inverse(least_y), _inverse(most_y), least_y < 0.0, margin_32, 1)
    z = slabs_of(low_z, high_z, _inverse(least_z), _inverse(most_z), least_z < 0.0, margin_32, 2)
    start, end = splat(-margin_32, CHILDREN), splat(np.float32(ahead), CHILDREN)
    found.stack[0], top, nodes = tree.nodes, 1, 0
    while top > 0:
        top -= 1
        node = found.stack[top]
        near, far = interval_in(node, start, end, x, y, z)
        bits, leaves = bits_of(near <= far), 0
        while bits:
            one = first_bit(bits)
            bits &= bits - 1
            if int32_at(node + BLOCK_COUNTS + 4 * one):
                leaves |= 1 << one
                continue
            found.stack[top] = child_node(tree, node, 4 * one)
            top += 1
        if leaves:
            if nodes == MOST_NODES:
                return -1
            found.nodes[nodes], found.leaves[nodes] = node, leaves
            nodes += 1
    return nodes


@njit(forceinline=True)
def _inverse(component):  # type: ignore[no-untyped-def]
    return np.float32(reciprocal(component))
