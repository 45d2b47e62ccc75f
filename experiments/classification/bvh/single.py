"""Traversal of a single ray from a list of nodes: both children's boxes in turn, triangles four at a time."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import uint32_at
from atra.compiled.memory import load, prefetch
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, lane, larger, smaller, splat, with_lane
from atra.embree.packets_kernels import MISS
from atra.trees.layout import BLOCK, BLOCK_BYTES, IDS
from experiments.classification.bvh.binary import NODE_BYTES, first_of, kind_of
from experiments.classification.bvh.triangles import meet

STEPS, BOXES, BLOCKS, LISTED, FROM_ROOT, PROVEN = range(6)
"""Indices of the traversal counters: nodes visited, boxes tested, blocks tested, list entries taken, rays started at
the root, and rays that miss because their list is empty or they pass the box of all shafts."""

COUNTS = 6

SMALLEST_COMPONENT = np.float32(1e-18)
"""Smaller direction components count as this, because 0 has no reciprocal. Directions have a size of 1 to 2."""

SLACK = np.float32(1.0 + 2.0**-20)
"""Factor on where a ray leaves a box and on its nearest hit; covers the rounding of the box test. Source: T. Ize,
"Robust BVH ray traversal", 2013."""

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


FETCHED = 4
"""List nodes that are prefetched before their turn."""


@njit(forceinline=True)
def fetch_node(tree, number):  # type: ignore[no-untyped-def]
    """Prefetch a node."""
    prefetch(tree.nodes + np.int64(number) * NODE_BYTES)


@njit(forceinline=True)
def reciprocal(component):  # type: ignore[no-untyped-def]
    """1 / component; a large number of the same sign where the component is nearly 0."""
    if abs(component) >= SMALLEST_COMPONENT:
        return np.float32(1.0) / component
    return np.float32(1.0) / (SMALLEST_COMPONENT if component >= _ZERO else -SMALLEST_COMPONENT)


@njit(forceinline=True)
def point(x, y, z):  # type: ignore[no-untyped-def]
    """(x, y, z, 0) as a vector."""
    return with_lane(with_lane(with_lane(splat(_ZERO, 4), 0, x), 1, y), 2, z)


@njit(forceinline=True)
def way_through(node, origin, inverse):  # type: ignore[no-untyped-def]
    """Where a ray enters and leaves the box of the node at an address."""
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


@njit(forceinline=True)
def nearer(bits, k, t, address, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit after the k-th triangle of a block, hit if its bit is set. On ties the lower prim_id wins."""
    if bits >> k & 1 and t <= best:
        found = uint32_at(address + 4 * k)
        if t < best or found < prim_id:
            return t, found
    return best, prim_id


@njit(forceinline=True)
def nearest_of_block(block, ray, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit after the block at an address."""
    x, y, z, dx, dy, dz, tnear = ray
    row = 4 * BLOCK
    zero, one = splat(_ZERO, BLOCK), splat(_ONE, BLOCK)
    away_x, away_y, away_z = splat(dx, BLOCK), splat(dy, BLOCK), splat(dz, BLOCK)
    x0, y0 = load(block, _ZERO, BLOCK), load(block + row, _ZERO, BLOCK)
    z0, x1 = load(block + 2 * row, _ZERO, BLOCK), load(block + 3 * row, _ZERO, BLOCK)
    y1, z1 = load(block + 4 * row, _ZERO, BLOCK), load(block + 5 * row, _ZERO, BLOCK)
    x2, y2 = load(block + 6 * row, _ZERO, BLOCK), load(block + 7 * row, _ZERO, BLOCK)
    z2 = load(block + 8 * row, _ZERO, BLOCK)
    ox, oy, oz = splat(x, BLOCK), splat(y, BLOCK), splat(z, BLOCK)
    hits, t = meet(x0, y0, z0, x1, y1, z1, x2, y2, z2, ox, oy, oz, away_x, away_y, away_z, zero, one)
    bits = bits_of(hits & (t > splat(tnear, BLOCK)) & (t <= splat(best, BLOCK)))
    if bits:
        best, prim_id = nearer(bits, 0, lane(t, 0), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 1, lane(t, 1), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 2, lane(t, 2), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 3, lane(t, 3), block + IDS, best, prim_id)
    return best, prim_id


@njit(forceinline=True)
def next_node(counting, tree, lists, start, left, stack, top, counts):  # type: ignore[no-untyped-def]
    """(address, whether it comes from the list, left, top) of the next node: from the top of the stack, else from the
    list, which has `left` nodes left."""
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


@njit(forceinline=True)
def nearest(push, any_hit, counting, tree, ray, tfar, lists, start, stack, nears, counts):  # type: ignore[no-untyped-def]
    """The nearest hit of a ray below the nodes of a list, as (t, prim_id); (tfar, MISS) for a miss. The list's last
    node comes first.

    push: test an inner node's children on entry and visit the nearer first; otherwise test a node when it is popped,
    with children ordered along their split axis. any_hit: stop at the first hit. counting: add to `counts`. ray:
    origin, direction and tnear. lists: see `bvh.starts.Shafts`; start: where the ray's list starts. stack: (STACK,)
    int64. nears: (STACK,) float32.
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
                    at = tree.blocks + block * BLOCK_BYTES
                    best, prim_id = nearest_of_block(at, ray, best, prim_id)
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
