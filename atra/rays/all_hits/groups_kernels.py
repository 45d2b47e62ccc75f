"""Rays that follow each other through a tree together, as those of neighbouring pixels do.

A group visits every node that one of its rays may enter: the numbers of its rays lie in intervals, and float32 rounds
monotonically. So its rays need only be tested with the boxes of the nodes found, which have leaves.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import load, prefetch
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, fused, larger, smaller, splat
from atra.rays.all_hits.boxes_kernels import ahead_of, margin_of, reciprocal, start_of
from atra.rays.all_hits.crossings_kernels import scaled_ray
from atra.trees.wide import CHILDREN, COUNTS, FIRSTS, HIGH, WIDE_BYTES

GROUP = 16
"""Rays that follow each other at most."""

MOST_NODES = 128
"""Nodes with leaves that a group may find; rays of others go alone, as do those that head for several octants."""

ROW = 4 * CHILDREN

_ZERO = np.float32(0.0)


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
    x, y = _axis(low_x, high_x, least_x, most_x, margin, 0), _axis(low_y, high_y, least_y, most_y, margin, ROW)
    z = _axis(low_z, high_z, least_z, most_z, margin, 2 * ROW)
    start, end = splat(np.float32(-margin), CHILDREN), splat(np.float32(ahead), CHILDREN)
    found.stack[0], top, nodes = tree.nodes, 1, 0
    while top > 0:
        top -= 1
        node = found.stack[top]
        near = larger(start, larger(_near(node, y), larger(_near(node, z), _near(node, x))))
        far = smaller(end, smaller(_far(node, y), smaller(_far(node, z), _far(node, x))))
        bits, leaves = bits_of(near <= far), 0
        while bits:
            one = first_bit(bits)
            bits &= bits - 1
            if int32_at(node + COUNTS + 4 * one):
                leaves |= 1 << one
                continue
            to = tree.nodes + np.int64(int32_at(node + FIRSTS + 4 * one)) * WIDE_BYTES
            prefetch(to)
            prefetch(to + 64)
            prefetch(to + 128)
            prefetch(to + 192)
            found.stack[top] = to
            top += 1
        if leaves:
            if nodes == MOST_NODES:
                return -1
            found.nodes[nodes], found.leaves[nodes] = node, leaves
            nodes += 1
    return nodes


@njit(forceinline=True)
def _axis(low, high, least, most, margin, row):  # type: ignore[no-untyped-def]
    """What box tests need of an axis: origins for the near and the far sides, both reciprocals, margins, places."""
    one, other = np.float32(reciprocal(least)), np.float32(reciprocal(most))
    outer = np.float32(margin * np.float64(max(abs(one), abs(other))))
    is_up = least >= 0.0
    near, far = (high if is_up else low), (low if is_up else high)
    return (
        splat(near, CHILDREN), splat(far, CHILDREN), splat(one, CHILDREN), splat(other, CHILDREN),
        splat(-outer, CHILDREN), splat(outer, CHILDREN),
        row if is_up else HIGH + row, HIGH + row if is_up else row,
    )  # fmt: skip


@njit(forceinline=True)
def _near(node, axis):  # type: ignore[no-untyped-def]
    origin, _, one, other, inner, _, place, _ = axis
    way = load(node + place, _ZERO, CHILDREN) - origin
    return smaller(fused(way, one, inner), fused(way, other, inner))


@njit(forceinline=True)
def _far(node, axis):  # type: ignore[no-untyped-def]
    _, origin, one, other, _, outer, _, place = axis
    way = load(node + place, _ZERO, CHILDREN) - origin
    return larger(fused(way, one, outer), fused(way, other, outer))
