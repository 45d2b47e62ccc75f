"""Counts along sampled rays: a SAH tree that is split only where a ray enters it, and the triangles in its leaves."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import float_part, kernel, njit
from atra.trees.building import Draft, cheapest_split, fill_bins, new_scratch, widen
from atra.trees.layout import BLOCK, DEEPEST
from experiments.law.model.counting_kernels import ROWS_A_WORD, SIDE, add_packets, first_bits

LEVELS = DEEPEST + 1

BEHIND = np.float32(1.0 + 1e-4)
"""Factor on the visible depth up to which a box or a hit counts as in front."""

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


_BITS = (1 << np.arange(SIDE)).astype(np.int32)


@float_part
def _enter(boxes, node, ways, depths, block, level, masks, front):  # type: ignore[no-untyped-def]
    """Which rays of a block enter a box, of those that enter its parent, and which do so before what they see; returns
    whether any does.

    ways: (B, 6, RAYS) float32, origins and reciprocals of directions. masks: (LEVELS + 1, B, SIDE) int32, of the parent
    at `level`, written at the next. front: (B, SIDE) int32, written.
    """
    lx, ly, lz, hx, hy, hz = (
        boxes[node, 0], boxes[node, 1], boxes[node, 2], boxes[node, 3], boxes[node, 4], boxes[node, 5]
    )  # fmt: skip
    met_any = np.int32(0)
    for row in range(SIDE):
        met, before = np.int32(0), np.int32(0)
        if masks[level, block, row]:
            for column in range(SIDE):  # sums, as these become vectors
                ray = row * SIDE + column
                ox, oy, oz = ways[block, 0, ray], ways[block, 1, ray], ways[block, 2, ray]
                wx, wy, wz = ways[block, 3, ray], ways[block, 4, ray], ways[block, 5, ray]
                ax, bx = (lx - ox) * wx, (hx - ox) * wx
                ay, by = (ly - oy) * wy, (hy - oy) * wy
                az, bz = (lz - oz) * wz, (hz - oz) * wz
                near = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), _ZERO))
                far = min(min(max(ax, bx), max(ay, by)), max(az, bz))
                met += _BITS[column] if near <= far else np.int32(0)
                before += _BITS[column] if near <= min(far, depths[block, ray]) else np.int32(0)
        masks[level + 1, block, row], front[block, row] = met, before
        met_any |= met
    return met_any != 0


@float_part
def _hit(corners, rays, depths, block, level, masks, hits, front):  # type: ignore[no-untyped-def]
    """Which rays of a block, of those that enter a leaf, hit a triangle, and which see it; returns whether any hits.

    corners: (3, 3) float32. masks: of the leaf at `level`. hits, front: (1, SIDE) int32, written. Source: T. Möller,
    B. Trumbore, 1997.
    """
    a0, a1, a2 = corners[0, 0], corners[0, 1], corners[0, 2]
    e0, e1, e2 = corners[1, 0] - a0, corners[1, 1] - a1, corners[1, 2] - a2
    f0, f1, f2 = corners[2, 0] - a0, corners[2, 1] - a1, corners[2, 2] - a2
    met_any = np.int32(0)
    for row in range(SIDE):
        met, before = np.int32(0), np.int32(0)
        mask = np.int32(masks[level, block, row])
        if mask:
            for column in range(SIDE):
                ray = row * SIDE + column
                d0, d1, d2 = rays[block, 3, ray], rays[block, 4, ray], rays[block, 5, ray]
                p0, p1, p2 = d1 * f2 - d2 * f1, d2 * f0 - d0 * f2, d0 * f1 - d1 * f0
                inverse = _ONE / (e0 * p0 + e1 * p1 + e2 * p2)  # of 0: infinite, and a test below fails
                t0, t1, t2 = rays[block, 0, ray] - a0, rays[block, 1, ray] - a1, rays[block, 2, ray] - a2
                u = (t0 * p0 + t1 * p1 + t2 * p2) * inverse
                q0, q1, q2 = t1 * e2 - t2 * e1, t2 * e0 - t0 * e2, t0 * e1 - t1 * e0
                v = (d0 * q0 + d1 * q1 + d2 * q2) * inverse
                depth = (f0 * q0 + f1 * q1 + f2 * q2) * inverse
                is_hit = (u >= _ZERO) & (v >= _ZERO) & (u + v <= _ONE) & (depth > _ZERO)
                met += _BITS[column] if is_hit else np.int32(0)
                before += _BITS[column] if is_hit & (depth <= depths[block, ray] * BEHIND) else np.int32(0)
            met &= mask
            before &= mask
        hits[0, row], front[0, row] = met, before
        met_any |= met
    return met_any != 0


SMALL = 256
"""Nodes of at most so many triangles are split in the middle of their centres, as bins cost more than they save."""

MOST_BINNED = 1024
"""Largest sample of a node's triangles that chooses its split."""


@float_part
def _middle(draft, start, end):  # type: ignore[no-untyped-def]
    """The axis on which the centres of triangles reach farthest, -1 if all coincide, and the middle there, doubled."""
    order, triangles = draft.order, draft.triangles
    axis, widest, cut = -1, _ZERO, _ZERO
    for one in range(3):
        low, high = np.float32(np.inf), -np.float32(np.inf)
        for place in range(start, end):
            middle = triangles[order[place], one] + triangles[order[place], 3 + one]
            low, high = min(low, middle), max(high, middle)
        if high - low > widest:
            axis, widest, cut = one, high - low, np.float32(0.5) * (low + high)
    return axis, cut


@float_part
def _part(draft, start, end, axis, cut, sides):  # type: ignore[no-untyped-def]
    """Sort positions [start, end) by the side of `cut` on which a triangle's centre, doubled, lies; returns where the
    second half starts. sides: (2, 6) float32, written: the boxes of both."""
    order, triangles = draft.order, draft.triangles
    for side in range(2):
        for one in range(3):
            sides[side, one], sides[side, 3 + one] = np.float32(np.inf), -np.float32(np.inf)
    first, last = start, end - 1
    while first <= last:
        triangle = order[first]
        side = np.int64(triangles[triangle, axis] + triangles[triangle, 3 + axis] >= cut)
        for one in range(3):
            sides[side, one] = min(sides[side, one], triangles[triangle, one])
            sides[side, 3 + one] = max(sides[side, 3 + one], triangles[triangle, 3 + one])
        if side:
            order[first], order[last] = order[last], triangle
            last -= 1
        else:
            first += 1
    return first


@njit
def _split(draft, start, end, picked, sides, scratch):  # type: ignore[no-untyped-def]
    """Split the node over positions [start, end); returns where its second half starts.

    picked: (MOST_BINNED,) int32, sides: (2, 6) float32, written.
    """
    axis, cut = -1, _ZERO
    if end - start > SMALL:
        count = min(end - start, MOST_BINNED)
        for k in range(count):
            picked[k] = draft.order[start + k * (end - start) // count]
        fill_bins(Draft(draft.boxes, draft.links, draft.triangles, picked), 0, count, scratch)
        axis, first_bin = cheapest_split(scratch)
        if axis >= 0:
            cut = scratch.middles[0, axis] + np.float32(first_bin) / scratch.middles[2, axis]
    else:
        axis, cut = _middle(draft, start, end)
    first = _part(draft, start, end, axis, cut, sides) if axis >= 0 else start
    if first in (start, end):  # all centres coincide, or nearly so: split anywhere
        first = (start + end) // 2
        for half in range(2):
            for one in range(3):
                sides[half, one], sides[half, 3 + one] = np.float32(np.inf), -np.float32(np.inf)
            for place in range(start if half == 0 else first, first if half == 0 else end):
                widen(sides[half], draft.triangles[draft.order[place]])
    for half in range(2):
        for one in range(6):
            draft.boxes[2 * first + half, one] = sides[half, one]
    return first


@kernel
def count_along_rays(vertices, faces, draft, rays, ways, depths, shapes, boxes, tested, met):  # type: ignore[no-untyped-def]
    """Add up what packets of sampled rays meet.

    vertices: (V, 3) float32, faces: (F, 3), draft: `atra.trees.building.Draft`, not yet split. rays: (B, 6, RAYS)
    float32, origins and directions of B blocks, row by row of pixels; ways: the same with reciprocals of directions.
    depths: (B, RAYS) float32, what each ray sees. shapes: (N, 2) int64, columns and rows of packets. Written, the
    second index along the whole ray, and up to what is seen: boxes (N, 2, LEVELS) int64, boxes of each level that a
    packet enters; tested (N, 2), triangles in leaves that it enters; met (N, 2), triangles that it hits.
    """
    blocks, kinds = len(rays), len(shapes)
    scratch, picked, sides = new_scratch(), np.empty(MOST_BINNED, np.int32), np.empty((2, 6), np.float32)
    stack = np.empty((DEEPEST + 2, 4), np.int64)
    active, counts = np.empty((LEVELS + 1, blocks), np.int64), np.zeros(LEVELS + 1, np.int64)
    masks, front = np.empty((LEVELS + 1, blocks, SIDE), np.int32), np.empty((blocks, SIDE), np.int32)
    hits, seen = np.empty((1, SIDE), np.int32), np.empty((1, SIDE), np.int32)
    words, entered, corners = (
        np.empty(ROWS_A_WORD, np.uint64),
        np.zeros((kinds, 2), np.int64),
        np.empty((3, 3), np.float32),
    )
    firsts = np.empty(kinds, np.uint64)
    for kind in range(kinds):
        firsts[kind] = first_bits(shapes[kind, 0], shapes[kind, 1])
    for block in range(blocks):
        active[0, block] = block
    counts[0] = blocks
    masks[0] = -1
    root = draft.boxes[0]
    for axis in range(3):
        root[axis], root[3 + axis] = np.float32(np.inf), -np.float32(np.inf)
    for place in range(len(draft.order)):
        widen(root, draft.triangles[draft.order[place]])
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, 0, len(draft.order), 0
    top = 1
    while top > 0:
        top -= 1
        node, start, end, level = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
        # Those of the parent stand one place before; its children are all that writes behind them.
        number = 0
        entered[:] = 0
        for k in range(counts[level]):
            block = active[level, k]
            if _enter(draft.boxes, node, ways, depths, block, level, masks, front):
                active[level + 1, number] = block
                number += 1
                add_packets(masks[level + 1], block, words, shapes, firsts, 0, entered)
                add_packets(front, block, words, shapes, firsts, 1, entered)
        counts[level + 1] = number
        if number == 0:
            continue
        for kind in range(kinds):
            boxes[kind, 0, level] += entered[kind, 0]
            boxes[kind, 1, level] += entered[kind, 1]
        if end - start > BLOCK and level < DEEPEST:
            middle = _split(draft, start, end, picked, sides, scratch)
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = 2 * middle + 1, middle, end, level + 1
            top += 1
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = 2 * middle, start, middle, level + 1
            top += 1
            continue
        for kind in range(kinds):
            tested[kind, 0] += (end - start) * entered[kind, 0]
            tested[kind, 1] += (end - start) * entered[kind, 1]
        for place in range(start, end):
            for corner in range(3):
                for axis in range(3):
                    corners[corner, axis] = vertices[faces[draft.order[place], corner], axis]
            for k in range(number):
                if _hit(corners, rays, depths, active[level + 1, k], level + 1, masks, hits, seen):
                    add_packets(hits, 0, words, shapes, firsts, 0, met)
                    add_packets(seen, 0, words, shapes, firsts, 1, met)
