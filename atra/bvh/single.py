"""The traversal of a single ray, from any list of nodes: children's boxes one by one, triangles four at a time."""

from __future__ import annotations

import numpy as np

from atra.bvh.layout import BLOCK, BLOCK_BYTES, IDS, NODE_BYTES, first_of, kind_of
from atra.bvh.triangles import CLAMP_SLACK, meet, meet_closed, shear_of
from atra.compiled.intrinsics import uint32_at
from atra.compiled.memory import fetch, load
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, lane, larger, repeated, size, smaller, with_lane
from atra.embree.packets_kernels import MISS

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

MARGIN = np.float32(2.0**-20)
"""Share of its distances to the box of all triangles, along an axis and along the major one, that a ray may pass beside
a box and still be traced through it: the sum of the roundings of a box's test, at most 3, and of the shear of a
triangle's corners, at most 6, is 9, and this is 16. Source: S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle
intersection", 2013, whose traversal moves the origin instead."""

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


FETCHED = 4
"""Nodes of a list that are on their way into the cache before their turn comes, which a tree's cannot be."""


@njit(forceinline=True)
def fetch_node(tree, number):  # type: ignore[no-untyped-def]
    """Ask for a node that will be read soon."""
    fetch(tree.nodes + np.int64(number) * NODE_BYTES)


@njit(forceinline=True)
def reciprocal(component):  # type: ignore[no-untyped-def]
    """Of a component of a direction; large where there is none."""
    if abs(component) >= SMALLEST_COMPONENT:
        return np.float32(1.0) / component
    return np.float32(1.0) / (SMALLEST_COMPONENT if component >= _ZERO else -SMALLEST_COMPONENT)


@njit(forceinline=True)
def point(x, y, z):  # type: ignore[no-untyped-def]
    """Three numbers as the first lanes of four; the last is 0."""
    return with_lane(with_lane(with_lane(repeated(_ZERO, 4), 0, x), 1, y), 2, z)


@njit(forceinline=True)
def margin_of(robust, tree, origin, inverse, dx, dy, dz):  # type: ignore[no-untyped-def]
    """By how much, in ray parameters, a ray may pass beside boxes along each axis, as the first lanes of four."""
    if not robust:
        return repeated(_ZERO, 4)
    reach = larger(
        size(load(tree.nodes, _ZERO, 4) - origin), size(load(tree.nodes + NODE_BYTES // 2, _ZERO, 4) - origin)
    )
    x, y, z = abs(dx), abs(dy), abs(dz)
    major = lane(reach, 0) if x >= y and x >= z else lane(reach, 1) if y >= z else lane(reach, 2)
    return (reach + repeated(major, 4)) * size(inverse) * repeated(MARGIN, 4)


@njit(forceinline=True)
def way_through(robust, node, origin, inverse, margin):  # type: ignore[no-untyped-def]
    """Where a ray enters the box of a node at an address, and where it leaves it. margin: of `margin_of`."""
    a = (load(node, _ZERO, 4) - origin) * inverse
    b = (load(node + NODE_BYTES // 2, _ZERO, 4) - origin) * inverse
    near, far = smaller(a, b), larger(a, b)
    if robust:
        near, far = near - margin, far + margin
    x, y, z = lane(near, 0), lane(near, 1), lane(near, 2)
    first = x if x > y else y
    first = first if first > z else z
    x, y, z = lane(far, 0), lane(far, 1), lane(far, 2)
    last = x if x < y else y
    last = last if last < z else z
    return first, last


@njit(forceinline=True)
def nearer(bits, k, t, address, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit so far and the k-th of a block, if its bit is set: of equally near ones the lower prim_id."""
    if bits >> k & 1 and t <= best:
        found = uint32_at(address + 4 * k)
        if t < best or found < prim_id:
            return t, found
    return best, prim_id


@njit(forceinline=True)
def nearest_of_block(robust, block, ray, shear, best, prim_id):  # type: ignore[no-untyped-def]
    """The nearest hit so far, and those of the triangles of the block at an address. shear: of the ray."""
    x, y, z, dx, dy, dz, tnear = ray
    row = 4 * BLOCK
    zero, one = repeated(_ZERO, BLOCK), repeated(_ONE, BLOCK)
    away_x, away_y, away_z = repeated(dx, BLOCK), repeated(dy, BLOCK), repeated(dz, BLOCK)
    x0, y0 = load(block, _ZERO, BLOCK), load(block + row, _ZERO, BLOCK)
    z0, x1 = load(block + 2 * row, _ZERO, BLOCK), load(block + 3 * row, _ZERO, BLOCK)
    y1, z1 = load(block + 4 * row, _ZERO, BLOCK), load(block + 5 * row, _ZERO, BLOCK)
    x2, y2 = load(block + 6 * row, _ZERO, BLOCK), load(block + 7 * row, _ZERO, BLOCK)
    z2 = load(block + 8 * row, _ZERO, BLOCK)
    ox, oy, oz = repeated(x, BLOCK), repeated(y, BLOCK), repeated(z, BLOCK)
    if robust:
        hits, t = meet_closed(
            x0 - ox, y0 - oy, z0 - oz, x1 - ox, y1 - oy, z1 - oz, x2 - ox, y2 - oy, z2 - oz,
            x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0,
            away_x, away_y, away_z, shear, zero, one, repeated(np.float32(CLAMP_SLACK), BLOCK),
        )  # fmt: skip
    else:
        hits, t = meet(
            x0 - ox, y0 - oy, z0 - oz, x1 - x0, y1 - y0, z1 - z0, x2 - x0, y2 - y0, z2 - z0,
            away_x, away_y, away_z, zero, one,
        )  # fmt: skip
    bits = bits_of(hits & (t > repeated(tnear, BLOCK)) & (t <= repeated(best, BLOCK)))
    if bits:
        best, prim_id = nearer(bits, 0, lane(t, 0), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 1, lane(t, 1), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 2, lane(t, 2), block + IDS, best, prim_id)
        best, prim_id = nearer(bits, 3, lane(t, 3), block + IDS, best, prim_id)
    return best, prim_id


@njit(forceinline=True)
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


@njit(forceinline=True)
def nearest(push, any_hit, counting, robust, tree, ray, tfar, lists, start, stack, nears, counts):  # type: ignore[no-untyped-def]
    """The nearest hit of a ray below the nodes of a list, the last of which comes first: (t, prim_id).

    push: an inner node's children are tested when it is entered, and the nearer one that is hit comes next; otherwise a
    node is tested when its turn comes, and its children's order is that of the axis that parts them. any_hit: the first
    hit ends it. counting: add to `counts`. robust: nothing slips through between triangles that share an edge or a
    corner. ray: origin, direction and tnear; tfar: as far as it reaches. lists: see
    `atra.bvh.starts.Shafts`; start: where that list begins. stack: int64, nears: float32, (STACK,). Without a
    hit the prim_id is MISS, and t is tfar.
    """
    x, y, z, dx, dy, dz, tnear = ray
    origin, inverse = point(x, y, z), point(reciprocal(dx), reciprocal(dy), reciprocal(dz))
    margin = margin_of(robust, tree, origin, inverse, dx, dy, dz)
    shear = shear_of(
        repeated(dx, BLOCK), repeated(dy, BLOCK), repeated(dz, BLOCK), repeated(_ZERO, BLOCK), repeated(_ONE, BLOCK)
    )
    ahead = (1 if dx > _ZERO else 0) | (2 if dy > _ZERO else 0) | (4 if dz > _ZERO else 0)
    best, prim_id, top, left = tfar, MISS, 0, np.int64(lists[start])
    while top > 0 or left > 0:
        node, is_entry, left, top = next_node(counting, tree, lists, start, left, stack, top, counts)
        if not push or is_entry:
            if counting:
                counts[BOXES] += 1
            first, last = way_through(robust, node, origin, inverse, margin)
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
                    best, prim_id = nearest_of_block(robust, at, ray, shear, best, prim_id)
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
            first0, last0 = way_through(robust, node, origin, inverse, margin)
            first1, last1 = way_through(robust, node + NODE_BYTES, origin, inverse, margin)
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
