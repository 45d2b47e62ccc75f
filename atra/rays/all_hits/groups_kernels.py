"""Rays that follow each other through a tree together, as those of neighbouring pixels do.

A group visits every node that one of its rays may enter: the numbers of its rays lie in intervals, and float32 rounds
monotonically. So its rays need only be tested with the boxes of the nodes found, which have leaves.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, splat
from atra.rays.all_hits.boxes_kernels import (
    ahead_of,
    child_node,
    interval_in,
    margin_of,
    reciprocal,
    slabs_of,
    start_of,
)
from atra.rays.rays_kernels import scaled_ray
from atra.trees.wide import BLOCK_COUNTS, CHILDREN

GROUP = 16
"""Rays that follow each other at most."""

MOST_NODES = 128
"""Nodes with leaves that a group may find; rays of others go alone, as do those that head for several octants."""


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
