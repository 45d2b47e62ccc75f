"""Counts along sampled rays: a SAH tree that is split only where a ray enters it, and the triangles in its leaves."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit
from atra.trees.building import new_scratch, split_node, widen
from atra.trees.layout import BLOCK, DEEPEST

SIDE = 16
"""Pixels along the side of a block of sampled rays; a row of them is the bits of one number."""

RAYS = SIDE * SIDE

LEVELS = DEEPEST + 1

BEHIND = np.float32(1.0 + 1e-4)
"""Factor on the visible depth up to which a box or a hit counts as in front."""

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


_BITS = (1 << np.arange(SIDE)).astype(np.int32)


_ROWS_A_WORD = 4

_SHIFT_ROW, _SHIFT_ROWS = np.uint64(SIDE), np.uint64(2 * SIDE)


@njit
def _bits(word):  # type: ignore[no-untyped-def]
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit
def _pack(masks, words):  # type: ignore[no-untyped-def]
    """Four rows of 16 bits to a word."""
    for k in range(_ROWS_A_WORD):
        words[k] = np.uint64(0)
        for row in range(_ROWS_A_WORD):
            words[k] |= np.uint64(masks[_ROWS_A_WORD * k + row]) << np.uint64(SIDE * row)


@njit
def _first_bits(width, height):  # type: ignore[no-untyped-def]
    """A word with the first bit of each packet."""
    word = np.uint64(0)
    for row in range(0, _ROWS_A_WORD, min(height, _ROWS_A_WORD)):
        for column in range(0, SIDE, width):
            word |= np.uint64(1) << np.uint64(SIDE * row + column)
    return word


@njit
def _packets_that_meet(words, width, height, firsts):  # type: ignore[no-untyped-def]
    """Packets of width x height rays of which at least one bit is set. words: (4,) uint64, a bit a ray."""
    count, together = 0, max(height // _ROWS_A_WORD, 1)
    for first in range(0, _ROWS_A_WORD, together):
        met = words[first]
        for other in range(first + 1, first + together):
            met |= words[other]
        if height > 1:
            met |= met >> _SHIFT_ROW
        if height > 2:
            met |= met >> _SHIFT_ROWS
        step = 1
        while step < width:
            met |= met >> np.uint64(step)
            step *= 2
        count += _bits(met & firsts)
    return count


@njit
def _enter(box, ways, depths, enters, leaves, masks, front):  # type: ignore[no-untyped-def]
    """Which rays of a block enter a box, and which do so before what they see; returns whether any does.

    ways: (6, RAYS) float32, origins and reciprocals of directions.
    """
    lx, ly, lz, hx, hy, hz = box[0], box[1], box[2], box[3], box[4], box[5]
    for ray in range(RAYS):
        ax, bx = (lx - ways[0, ray]) * ways[3, ray], (hx - ways[0, ray]) * ways[3, ray]
        ay, by = (ly - ways[1, ray]) * ways[4, ray], (hy - ways[1, ray]) * ways[4, ray]
        az, bz = (lz - ways[2, ray]) * ways[5, ray], (hz - ways[2, ray]) * ways[5, ray]
        near = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), _ZERO))
        enters[ray] = near
        leaves[ray] = min(min(max(ax, bx), max(ay, by)), max(az, bz))
    met_any = 0
    for row in range(SIDE):
        met, before = np.int32(0), np.int32(0)
        for column in range(SIDE):  # sums, as these become vectors
            ray = row * SIDE + column
            met += _BITS[column] if enters[ray] <= leaves[ray] else np.int32(0)
            before += _BITS[column] if enters[ray] <= min(leaves[ray], depths[ray]) else np.int32(0)
        masks[row], front[row] = met, before
        met_any |= met
    return met_any != 0


@njit
def _hit(a, b, c, rays, depths, masks, hits, front):  # type: ignore[no-untyped-def]
    """Which rays of those in `masks` hit a triangle, and which of them see it. Source: T. Möller, B. Trumbore, 1997."""
    e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    f0, f1, f2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    for row in range(SIDE):
        hits[row], front[row] = 0, 0
        if masks[row] == 0:
            continue
        for column in range(SIDE):
            if not (masks[row] >> column) & 1:
                continue
            ray = row * SIDE + column
            d0, d1, d2 = rays[3, ray], rays[4, ray], rays[5, ray]
            p0, p1, p2 = d1 * f2 - d2 * f1, d2 * f0 - d0 * f2, d0 * f1 - d1 * f0
            det = e0 * p0 + e1 * p1 + e2 * p2
            if det == _ZERO:
                continue
            inverse = _ONE / det
            t0, t1, t2 = rays[0, ray] - a[0], rays[1, ray] - a[1], rays[2, ray] - a[2]
            u = (t0 * p0 + t1 * p1 + t2 * p2) * inverse
            q0, q1, q2 = t1 * e2 - t2 * e1, t2 * e0 - t0 * e2, t0 * e1 - t1 * e0
            v = (d0 * q0 + d1 * q1 + d2 * q2) * inverse
            depth = (f0 * q0 + f1 * q1 + f2 * q2) * inverse
            if u >= _ZERO and v >= _ZERO and u + v <= _ONE and depth > _ZERO:
                hits[row] |= 1 << column
                if depth <= depths[ray] * BEHIND:
                    front[row] |= 1 << column


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
    scratch = new_scratch()
    stack = np.empty((DEEPEST + 2, 4), np.int64)
    active, counts = np.empty((LEVELS + 1, blocks), np.int64), np.zeros(LEVELS + 1, np.int64)
    masks, front, hits, seen = (np.zeros((blocks, SIDE), np.int64), np.zeros((blocks, SIDE), np.int64),
                                np.zeros(SIDE, np.int64), np.zeros(SIDE, np.int64))  # fmt: skip
    all_words, front_words = np.empty((2, blocks, _ROWS_A_WORD), np.uint64)
    hit_words, seen_words = np.empty((2, _ROWS_A_WORD), np.uint64)
    firsts = np.empty(kinds, np.uint64)
    for kind in range(kinds):
        firsts[kind] = _first_bits(shapes[kind, 0], shapes[kind, 1])
    enters, leaves = np.empty(RAYS, np.float32), np.empty(RAYS, np.float32)
    for block in range(blocks):
        active[0, block] = block
    counts[0] = blocks
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
        for k in range(counts[level]):
            block = active[level, k]
            if _enter(draft.boxes[node], ways[block], depths[block], enters, leaves, masks[block], front[block]):
                active[level + 1, number] = block
                number += 1
                _pack(masks[block], all_words[block])
                _pack(front[block], front_words[block])
                for kind in range(kinds):
                    width, height = shapes[kind, 0], shapes[kind, 1]
                    boxes[kind, 0, level] += _packets_that_meet(all_words[block], width, height, firsts[kind])
                    boxes[kind, 1, level] += _packets_that_meet(front_words[block], width, height, firsts[kind])
        counts[level + 1] = number
        if number == 0:
            continue
        if end - start > BLOCK and level < DEEPEST:
            middle = split_node(draft, node, start, end, scratch)
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = 2 * middle + 1, middle, end, level + 1
            top += 1
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = 2 * middle, start, middle, level + 1
            top += 1
            continue
        for k in range(number):
            block = active[level + 1, k]
            for kind in range(kinds):
                width, height = shapes[kind, 0], shapes[kind, 1]
                count = end - start
                tested[kind, 0] += count * _packets_that_meet(all_words[block], width, height, firsts[kind])
                tested[kind, 1] += count * _packets_that_meet(front_words[block], width, height, firsts[kind])
            for place in range(start, end):
                face = faces[draft.order[place]]
                _hit(
                    vertices[face[0]], vertices[face[1]], vertices[face[2]], rays[block], depths[block], masks[block],
                    hits, seen,
                )  # fmt: skip
                _pack(hits, hit_words)
                _pack(seen, seen_words)
                for kind in range(kinds):
                    width, height = shapes[kind, 0], shapes[kind, 1]
                    met[kind, 0] += _packets_that_meet(hit_words, width, height, firsts[kind])
                    met[kind, 1] += _packets_that_meet(seen_words, width, height, firsts[kind])
