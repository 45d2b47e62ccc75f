"""The BVH build: binary, top-down, by the surface area heuristic (SAH) over 32 bins; threads share the subtrees.

The SAH counts the blocks of four triangles in a leaf, as a block is tested at once. Source: I. Wald, "On fast
construction of SAH-based bounding volume hierarchies", 2007.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.trees.layout import BLOCK, DEEPEST

BINS = 32

_INFINITY = np.float32(np.inf)
_CHUNK = 4096


class Draft(NamedTuple):
    """A BVH under construction.

    boxes: (N, 6) float32, lowest and highest corner of each node. links: (N, 3) int32; inner node: first child, 0,
    split axis; leaf: first position in `order`, number of triangles, 0. triangles: (F, 6) float32, boxes of triangles.
    order: (T,) int32, triangles to include; the build sorts them leaf by leaf. The root is node 0. A node split at
    position m has the children 2 m and 2 m + 1; no two nodes are split at the same position, so threads never collide.
    """

    boxes: NDArray[np.float32]
    links: NDArray[np.int32]
    triangles: NDArray[np.float32]
    order: NDArray[np.int32]


@kernel
def bound_triangles(counter_address, vertices, faces, triangles):  # type: ignore[no-untyped-def]
    """Write the boxes of all triangles, (F, 6). Threads share the counter."""
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(faces):
            return
        for face in range(start, min(start + _CHUNK, len(faces))):
            for axis in range(3):
                a = vertices[faces[face, 0], axis]
                b = vertices[faces[face, 1], axis]
                c = vertices[faces[face, 2], axis]
                triangles[face, axis] = min(a, b, c)
                triangles[face, 3 + axis] = max(a, b, c)


@njit
def _half_area(box):  # type: ignore[no-untyped-def]
    x = np.float64(box[3]) - np.float64(box[0])
    y = np.float64(box[4]) - np.float64(box[1])
    z = np.float64(box[5]) - np.float64(box[2])
    return x * y + y * z + z * x


@njit
def _empty(box):  # type: ignore[no-untyped-def]
    for axis in range(3):
        box[axis], box[3 + axis] = _INFINITY, -_INFINITY


@njit
def widen(box, other):  # type: ignore[no-untyped-def]
    for axis in range(3):
        if other[axis] < box[axis]:
            box[axis] = other[axis]
        if other[3 + axis] > box[3 + axis]:
            box[3 + axis] = other[3 + axis]


@njit
def _bin_of(box, axis, low, scale):  # type: ignore[no-untyped-def]
    place = int((box[axis] + box[3 + axis] - low) * scale)
    return min(max(place, 0), BINS - 1)


class Scratch(NamedTuple):
    """Memory of one build thread. middles: (3, 3) float32, lowest and highest box centre per axis (doubled), and bins
    per unit. counts: (3, BINS) int64. bins: (3, BINS, 6) float32. costs: (BINS,) float64. side: (6,) float32."""

    middles: NDArray[np.float32]
    counts: NDArray[np.int64]
    bins: NDArray[np.float32]
    costs: NDArray[np.float64]
    side: NDArray[np.float32]


@njit
def new_scratch():  # type: ignore[no-untyped-def]
    return Scratch(
        np.empty((3, 3), np.float32),
        np.empty((3, BINS), np.int64),
        np.empty((3, BINS, 6), np.float32),
        np.empty(BINS, np.float64),
        np.empty(6, np.float32),
    )


@njit
def fill_bins(draft, start, end, scratch):  # type: ignore[no-untyped-def]
    low, high, scale = scratch.middles[0], scratch.middles[1], scratch.middles[2]
    low[:], high[:], scale[:] = _INFINITY, -_INFINITY, 0
    for place in range(start, end):
        box = draft.triangles[draft.order[place]]
        for axis in range(3):
            middle = box[axis] + box[3 + axis]
            low[axis] = min(low[axis], middle)
            high[axis] = max(high[axis], middle)
    for axis in range(3):
        extent = high[axis] - low[axis]
        if extent > 0 and np.float32(BINS) / extent < _INFINITY:
            scale[axis] = np.float32(BINS) / extent
        for k in range(BINS):
            scratch.counts[axis, k] = 0
            _empty(scratch.bins[axis, k])
    for place in range(start, end):
        box = draft.triangles[draft.order[place]]
        for axis in range(3):
            k = _bin_of(box, axis, low[axis], scale[axis])
            scratch.counts[axis, k] += 1
            widen(scratch.bins[axis, k], box)


@njit
def _cost(box, triangles):  # type: ignore[no-untyped-def]
    """SAH cost of one side of a split: the box's area times its blocks."""
    return _half_area(box) * ((triangles + BLOCK - 1) // BLOCK) if triangles else np.inf


@njit
def cheapest_split(scratch):  # type: ignore[no-untyped-def]
    """(axis, first bin of the second half) of the cheapest split; axis -1 if all centres coincide."""
    side, costs = scratch.side, scratch.costs
    best, best_axis, best_bin = np.inf, -1, 0
    for axis in range(3):
        if scratch.middles[2, axis] == 0:
            continue
        counts, bins = scratch.counts[axis], scratch.bins[axis]
        _empty(side)
        number = 0
        for k in range(BINS - 1, 0, -1):
            number += counts[k]
            widen(side, bins[k])
            costs[k] = _cost(side, number)
        _empty(side)
        number = 0
        for k in range(1, BINS):
            number += counts[k - 1]
            widen(side, bins[k - 1])
            cost = _cost(side, number) + costs[k]
            if cost < best:
                best, best_axis, best_bin = cost, axis, k
    return best_axis, best_bin


@njit
def split_node(draft, node, start, end, scratch):  # type: ignore[no-untyped-def]
    """Split the node over positions [start, end); returns where its second half starts."""
    fill_bins(draft, start, end, scratch)
    axis, first_bin = cheapest_split(scratch)
    order, triangles = draft.order, draft.triangles
    if axis < 0:  # all centres coincide: split anywhere
        axis, middle = 0, (start + end) // 2
    else:
        low, scale = scratch.middles[0, axis], scratch.middles[2, axis]
        middle, last = start, end - 1
        while middle <= last:
            triangle = order[middle]
            if _bin_of(triangles[triangle], axis, low, scale) < first_bin:
                middle += 1
            else:
                order[middle], order[last] = order[last], triangle
                last -= 1
    child = 2 * middle
    for half in range(2):
        box = draft.boxes[child + half]
        _empty(box)
        for place in range(start if half == 0 else middle, middle if half == 0 else end):
            widen(box, triangles[order[place]])
    draft.links[node, 0], draft.links[node, 1], draft.links[node, 2] = child, 0, axis
    return middle


@kernel
def split_top(draft, tasks, size):  # type: ignore[no-untyped-def]
    """Split from the root until no subtree has more than `size` triangles; returns the number of subtrees.

    tasks: (M, 4) int64, written: node, start, end and depth of each.
    """
    scratch = new_scratch()
    box = draft.boxes[0]
    _empty(box)
    for place in range(len(draft.order)):
        widen(box, draft.triangles[draft.order[place]])
    tasks[0, 0], tasks[0, 1], tasks[0, 2], tasks[0, 3] = 0, 0, len(draft.order), 0
    count, done = 1, 0
    while done < count:
        node, start, end, depth = tasks[done, 0], tasks[done, 1], tasks[done, 2], tasks[done, 3]
        if end - start <= size or count == len(tasks) or depth >= DEEPEST:
            done += 1
            continue
        middle = split_node(draft, node, start, end, scratch)
        tasks[done, 0], tasks[done, 2], tasks[done, 3] = 2 * middle, middle, depth + 1
        tasks[count, 0], tasks[count, 1], tasks[count, 2], tasks[count, 3] = 2 * middle + 1, middle, end, depth + 1
        count += 1
    return count


@kernel
def build_subtrees(counter_address, draft, tasks):  # type: ignore[no-untyped-def]
    """Build the subtrees of `tasks`. Threads share the counter."""
    scratch = new_scratch()
    stack = np.empty((DEEPEST + 2, 4), np.int64)
    while True:
        task = fetch_add(counter_address, 1)
        if task >= len(tasks):
            return
        stack[0] = tasks[task]
        top = 1
        while top > 0:
            top -= 1
            node, start, end, depth = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
            if end - start <= BLOCK or depth >= DEEPEST:
                draft.links[node, 0], draft.links[node, 1], draft.links[node, 2] = start, end - start, 0
                continue
            middle = split_node(draft, node, start, end, scratch)
            child, deeper = 2 * middle, depth + 1
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = child + 1, middle, end, deeper
            top += 1
            stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3] = child, start, middle, deeper
            top += 1


@kernel
def fill_blocks(counter_address, vertices, faces, order, leaves, blocks):  # type: ignore[no-untyped-def]
    """Copy corners and prim_ids of each leaf's triangles into its blocks, (B, 10, BLOCK) uint32."""
    floats = blocks.view(np.float32)
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(leaves):
            return
        for leaf in range(start, min(start + _CHUNK, len(leaves))):
            first, count, block = leaves[leaf, 0], leaves[leaf, 1], leaves[leaf, 2]
            for k in range(count):
                face = order[first + k]
                into, place = block + k // BLOCK, k % BLOCK
                for corner in range(3):
                    for axis in range(3):
                        floats[into, 3 * corner + axis, place] = vertices[faces[face, corner], axis]
                blocks[into, 9, place] = face
