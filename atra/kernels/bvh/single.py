"""The traversal of a single ray, from any list of nodes: children's boxes one by one, triangles four at a time."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.bvh.layout import BLOCK, BLOCK_BYTES, IDS, NODE_BYTES, first_of, kind_of
from atra.kernels.bvh.triangles import meet
from atra.kernels.gathering.lanes import uint32_at
from atra.kernels.packets import MISS
from atra.kernels.raster.memory import fetch, load
from atra.kernels.raster.vectors import bits_of, lane, larger, repeated, smaller, with_lane

STEPS, BOXES, BLOCKS, LISTED, FROM_ROOT, PROVEN = range(6)
"""What is counted: nodes popped or descended into, boxes tested, blocks of triangles tested, entries of lists taken,
rays that start from the root, and rays that miss because their list is empty or they pass the box of all shafts."""

COUNTS = 6

SMALLEST_COMPONENT = np.float32(1e-18)
"""Components of a direction that are smaller count as this, as 0 has no reciprocal; of directions of 1 to 2 in size."""

SLACK = np.float32(1.0 + 2.0**-20)
"""By how much the end of a ray's way through a box is taken too far, whether it leaves the box there or has hit
something: more than roundings make it too near. Source: T. Ize, "Robust BVH ray traversal", 2013.
"""

_ZERO = np.float32(0.0)


FETCHED = 4
"""Nodes of a list that are on their way into the cache before their turn comes, which a tree's cannot be."""


@njit(inline="always")
def fetch_node(tree, number):  # type: ignore[no-untyped-def]
    """Ask for a node that will be read soon."""
    fetch(tree.nodes + np.int64(number) * NODE_BYTES)


@njit(inline="always")
def reciprocal(component):  # type: ignore[no-untyped-def]
    """Of a component of a direction; large where there is none."""
    if abs(component) >= SMALLEST_COMPONENT:
        return np.float32(1.0) / component
    return np.float32(1.0) / (SMALLEST_COMPONENT if component >= _ZERO else -SMALLEST_COMPONENT)


@njit(inline="always")
def point(x, y, z):  # type: ignore[no-untyped-def]
    """Three numbers as the first lanes of four; the last is 0."""
    return with_lane(with_lane(with_lane(repeated(_ZERO, 4), 0, x), 1, y), 2, z)


@njit(inline="always")
def way_through(node, origin, inverse):  # type: ignore[no-untyped-def]
    """Where a ray enters the box of a node at an address, and where it leaves it."""
    a = (load(node, _ZERO, 4) - origin) * inverse
    b = (load(node + NODE_BYTES // 2, _ZERO, 4) - origin) * inverse
    near, far = smaller(a, b), larger(a, b)
    x, y, z = lane(near, 0), lane(near, 1), lane(near, 2)
    first = x if x > y else y
    first = first if first > z else z
    x, y, z = lane(far, 0), lane(far, 1), lane(far, 2)
    last = x if x < y else y
    last = last if last < z else z
    return first, last


@njit(inline="always")
def nearer(bits, k, t, address, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit so far and the k-th of a block, if its bit is set: of equally near ones the lower prim_id."""
    if bits >> k & 1 and t <= best:
        found = uint32_at(address + 4 * k)
        if t < best or found < prim_id:
            return t, found
    return best, prim_id


@njit(inline="always")
def nearest_of_block(block, ray, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit so far, and those of the triangles of the block at an address."""
    x, y, z, dx, dy, dz, tnear = ray
    row = 4 * BLOCK
    hits, t = meet(
        load(block, _ZERO, BLOCK) - repeated(x, BLOCK),
        load(block + row, _ZERO, BLOCK) - repeated(y, BLOCK),
        load(block + 2 * row, _ZERO, BLOCK) - repeated(z, BLOCK),
        load(block + 3 * row, _ZERO, BLOCK),
        load(block + 4 * row, _ZERO, BLOCK),
        load(block + 5 * row, _ZERO, BLOCK),
        load(block + 6 * row, _ZERO, BLOCK),
        load(block + 7 * row, _ZERO, BLOCK),
        load(block + 8 * row, _ZERO, BLOCK),
        repeated(dx, BLOCK),
        repeated(dy, BLOCK),
        repeated(dz, BLOCK),
        repeated(_ZERO, BLOCK),
        repeated(np.float32(1.0), BLOCK),
    )
    bits = bits_of(hits & (t > repeated(tnear, BLOCK)) & (t <= repeated(best, BLOCK)))
    if bits:
        best, prim_id = nearer(bits, 0, lane(t, 0), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 1, lane(t, 1), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 2, lane(t, 2), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 3, lane(t, 3), block + IDS, best, prim_id)
    return best, prim_id


@njit(inline="always")
def next_node(counting, tree, lists, start, left, stack, top, counts):  # type: ignore[no-untyped-def]
    """(address, whether it is from the list, left, top) of the node whose turn it is: that on top of the stack, or the
    next of a list of which so many are left."""
    is_entry = top == 0
    if is_entry:
        number = np.int64(lists[start + left])
        left -= 1
        fetch_node(tree, lists[start + max(left + 1 - FETCHED, 0)])
        if counting:
            counts[LISTED] += 1
    else:
        top -= 1
        number = stack[top]
    return tree.nodes + number * NODE_BYTES, is_entry, left, top


@njit(inline="always")
def nearest(push, any_hit, counting, tree, ray, tfar, lists, start, stack, nears, counts):  # type: ignore[no-untyped-def]
    """The nearest hit of a ray below the nodes of a list, the last of which comes first: (t, prim_id).

    push: an inner node's children are tested when it is entered, and the nearer one that is hit comes next; otherwise a
    node is tested when its turn comes, and its children's order is that of the axis that parts them. any_hit: the first
    hit ends it. counting: add to `counts`. ray: origin, direction and tnear; tfar: as far as it reaches. lists: see
    `atra.kernels.shafts.grid.Shafts`; start: where that list begins. stack: int64, nears: float32, (STACK,). Without a
    hit the prim_id is MISS, and t is tfar.
    """
    x, y, z, dx, dy, dz, tnear = ray
    origin, inverse = point(x, y, z), point(reciprocal(dx), reciprocal(dy), reciprocal(dz))
    ahead = (1 if dx > _ZERO else 0) | (2 if dy > _ZERO else 0) | (4 if dz > _ZERO else 0)
    best, prim_id, top, left = tfar, MISS, 0, np.int64(lists[start])
    while top > 0 or left > 0:
        node, is_entry, left, top = next_node(counting, tree, lists, start, left, stack, top, counts)
        if not push or is_entry:
            if counting:
                counts[BOXES] += 1
            first, last = way_through(node, origin, inverse)
            entered = max(first, tnear) <= min(last, best) * SLACK
        else:
            entered = nears[top] <= best * SLACK
        if counting and not push:
            counts[STEPS] += 1
        while entered:
            if counting and push:
                counts[STEPS] += 1
            child, kind = first_of(node), kind_of(node)
            if kind > 3:
                for block in range(child, child + (kind >> 2)):
                    if counting:
                        counts[BLOCKS] += 1
                    best, prim_id = nearest_of_block(tree.blocks + block * BLOCK_BYTES, ray, best, prim_id)
                if any_hit and prim_id != MISS:
                    top = left = 0
                break
            if not push:
                second = ahead >> kind & 1
                stack[top], stack[top + 1] = child + second, child + 1 - second
                top += 2
                break
            node = tree.nodes + child * NODE_BYTES
            if counting:
                counts[BOXES] += 2
            first0, last0 = way_through(node, origin, inverse)
            first1, last1 = way_through(node + NODE_BYTES, origin, inverse)
            enters0 = max(first0, tnear) <= min(last0, best) * SLACK
            enters1 = max(first1, tnear) <= min(last1, best) * SLACK
            if enters0 and enters1:
                if first0 <= first1:
                    stack[top], nears[top] = child + 1, first1
                else:
                    stack[top], nears[top] = child, first0
                    node += NODE_BYTES
                top += 1
            elif enters1:
                node += NODE_BYTES
            else:
                entered = enters0
    return best, prim_id
