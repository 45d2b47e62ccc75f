"""Traversal of a packet of rays from a list of nodes: one box or triangle at a time against all rays."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import float_at, uint32_at
from atra.compiled.lanes import is_below
from atra.compiled.memory import load, store
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, lane, larger, smaller, splat, where
from atra.embree.packets_kernels import MISS
from atra.trees.layout import BLOCK, BLOCK_BYTES, IDS
from experiments.classification.bvh.binary import NODE_BYTES, first_of, kind_of
from experiments.classification.bvh.single import BLOCKS, BOXES, MARGIN, SLACK, STEPS, next_node
from experiments.classification.bvh.triangles import CLAMP_SLACK, meet_corners, shear_of

X, Y, Z, DIRECTION_X, DIRECTION_Y, DIRECTION_Z, INVERSE_X, INVERSE_Y, INVERSE_Z, TNEAR, TFAR, PRIM_ID = range(12)
"""Rows of a bundle: one ray a column, then its hit. All are float32 except PRIM_ID, which is uint32."""

ROWS = 12

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)
_NOTHING = np.float32(np.inf)


@njit(forceinline=True)
def _reach(tree, axis, width, place):  # type: ignore[no-untyped-def]
    """The largest distance along an axis from origins to the ends of the root's box."""
    low, high = tree.nodes + 4 * axis, tree.nodes + NODE_BYTES // 2 + 4 * axis
    return larger(abs(splat(float_at(low), width) - place), abs(splat(float_at(high), width) - place))


@njit(forceinline=True)
def _margins(robust, tree, width, x, y, z, across, along, away, shear):  # type: ignore[no-untyped-def]
    """`bvh.single.margin_of` for the rays of a packet."""
    if not robust:
        none = splat(_ZERO, width)
        return none, none, none
    a, b, c = _reach(tree, 0, width, x), _reach(tree, 1, width, y), _reach(tree, 2, width, z)
    major, share = where(shear[0], a, where(shear[1], b, c)), splat(MARGIN, width)
    return (a + major) * abs(across) * share, (b + major) * abs(along) * share, (c + major) * abs(away) * share


@njit(forceinline=True)
def ways_through(robust, node, width, x, y, z, across, along, away, margins):  # type: ignore[no-untyped-def]
    """Where rays enter and leave the box of the node at an address. margins: from `_margins`."""
    x0 = (splat(float_at(node), width) - x) * across
    x1 = (splat(float_at(node + 16), width) - x) * across
    y0 = (splat(float_at(node + 4), width) - y) * along
    y1 = (splat(float_at(node + 20), width) - y) * along
    z0 = (splat(float_at(node + 8), width) - z) * away
    z1 = (splat(float_at(node + 24), width) - z) * away
    x0, x1, y0, y1, z0, z1 = (
        smaller(x0, x1),
        larger(x0, x1),
        smaller(y0, y1),
        larger(y0, y1),
        smaller(z0, z1),
        larger(z0, z1),
    )
    if robust:
        x0, y0, z0 = x0 - margins[0], y0 - margins[1], z0 - margins[2]
        x1, y1, z1 = x1 + margins[0], y1 + margins[1], z1 + margins[2]
    return larger(larger(x0, y0), z0), smaller(smaller(x1, y1), z1)


@njit(forceinline=True)
def nearest_of_packet(  # type: ignore[no-untyped-def]
    width, push, any_hit, counting, robust, tree, bundle, lists, start, stack, ways, counts
):
    """Find the nearest hits of a bundle below the nodes of a list.

    push, any_hit, counting, robust, lists, start, stack: as for `bvh.single.nearest`. bundle: address of ROWS x
    `width`; hits are written to TFAR and PRIM_ID. A lane with negative TFAR is idle. ways: address of STACK x `width`
    float32. The first ray decides the order of children.
    """
    row = 4 * width
    x, y, z = load(bundle, _ZERO, width), load(bundle + row, _ZERO, width), load(bundle + 2 * row, _ZERO, width)
    dx = load(bundle + DIRECTION_X * row, _ZERO, width)
    dy = load(bundle + DIRECTION_Y * row, _ZERO, width)
    dz = load(bundle + DIRECTION_Z * row, _ZERO, width)
    across = load(bundle + INVERSE_X * row, _ZERO, width)
    along = load(bundle + INVERSE_Y * row, _ZERO, width)
    away = load(bundle + INVERSE_Z * row, _ZERO, width)
    tnear, best = load(bundle + TNEAR * row, _ZERO, width), load(bundle + TFAR * row, _ZERO, width)
    prim_ids = splat(MISS, width)
    zero, one, nothing = splat(_ZERO, width), splat(_ONE, width), splat(_NOTHING, width)
    shear = shear_of(dx, dy, dz, zero, one)
    margins = _margins(robust, tree, width, x, y, z, across, along, away, shear)
    ahead = (1 if lane(dx, 0) > _ZERO else 0) | (2 if lane(dy, 0) > _ZERO else 0) | (4 if lane(dz, 0) > _ZERO else 0)
    slack, top, left = splat(SLACK, width), 0, np.int64(lists[start])
    while top > 0 or left > 0:
        node, is_entry, left, top = next_node(counting, tree, lists, start, left, stack, top, counts)
        if not push or is_entry:
            if counting:
                counts[BOXES] += 1
            first, last = ways_through(robust, node, width, x, y, z, across, along, away, margins)
            entered = bits_of(larger(first, tnear) <= smaller(last, best) * slack) != 0
        else:
            entered = bits_of(load(ways + top * row, _ZERO, width) <= best * slack) != 0
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
                    for k in range(BLOCK):
                        at = tree.blocks + block * BLOCK_BYTES + 4 * k
                        step = 4 * BLOCK
                        x0, y0 = splat(float_at(at), width), splat(float_at(at + step), width)
                        z0, x1 = splat(float_at(at + 2 * step), width), splat(float_at(at + 3 * step), width)
                        y1, z1 = splat(float_at(at + 4 * step), width), splat(float_at(at + 5 * step), width)
                        x2, y2 = splat(float_at(at + 6 * step), width), splat(float_at(at + 7 * step), width)
                        z2 = splat(float_at(at + 8 * step), width)
                        hits, t = meet_corners(
                            robust, x0, y0, z0, x1, y1, z1, x2, y2, z2, x, y, z, dx, dy, dz, shear, zero, one,
                            splat(np.float32(CLAMP_SLACK), width),
                        )  # fmt: skip
                        found = splat(uint32_at(at + IDS), width)
                        as_near = (t >= best) & (t <= best) & is_below(found, prim_ids)
                        hits = hits & (t > tnear) & ((best > t) | as_near)
                        if bits_of(hits):
                            best, prim_ids = where(hits, t, best), where(hits, found, prim_ids)
                            if any_hit:  # ends these rays
                                best = where(hits, zero - nothing, best)
                if any_hit and bits_of(best >= zero) == 0:
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
            first0, last0 = ways_through(robust, node, width, x, y, z, across, along, away, margins)
            first1, last1 = ways_through(robust, node + NODE_BYTES, width, x, y, z, across, along, away, margins)
            enters0 = larger(first0, tnear) <= smaller(last0, best) * slack
            enters1 = larger(first1, tnear) <= smaller(last1, best) * slack
            if bits_of(enters0) and bits_of(enters1):
                if ahead >> kind & 1:
                    stack[top] = child + 1
                    store(where(enters1, first1, nothing), ways + top * row)
                else:
                    stack[top] = child
                    store(where(enters0, first0, nothing), ways + top * row)
                    node += NODE_BYTES
                top += 1
            elif bits_of(enters1):
                node += NODE_BYTES
            else:
                entered = bits_of(enters0) != 0
    store(best, bundle + TFAR * row)
    store(prim_ids, bundle + PRIM_ID * row)
