"""A BVH of eight children per node; all boxes of a node are tested at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import kernel
from atra.compiled.threads import WorkerPool
from atra.trees.building import Draft, bound_triangles, build_subtrees, fill_blocks, split_top
from atra.trees.layout import BLOCK

CHILDREN = 8

WIDE_BYTES = 32 * CHILDREN
"""A node: lowest x of its children's boxes, y, z, highest x, y, z; then first child or block, then the number of blocks
of a leaf, 0 of an inner node; 4 bytes each. Unused children have NaN boxes, which no ray enters."""

HIGH, FIRSTS, BLOCK_COUNTS = 12 * CHILDREN, 24 * CHILDREN, 28 * CHILDREN
"""Byte offsets of the highest corners, the first children and the numbers of blocks."""

_DEEPEST = 64

_CACHE_LINE = 64

_TASKS = 64
"""Subtrees that the build threads share; many more than threads, so that all stay busy."""


@dataclass(frozen=True, eq=False)
class WideBvh:
    """nodes: (N, 8, 8) uint32 and blocks: (B, 10, 4) uint32, laid out as said above and in `atra.trees.layout`."""

    nodes: NDArray[np.uint32]
    blocks: NDArray[np.uint32]


def wide_bvh(
    vertices: NDArray[np.float32], faces: NDArray[np.uint32], kept: NDArray[np.bool_], pool: WorkerPool
) -> WideBvh:
    """The tree of the triangles selected by `kept`. The same to the bit for any number of threads.

    vertices: (V, 3) float32. faces: (F, 3) uint32. kept: (F,) bool. Without triangles it is a tree that no ray enters.
    """
    count = int(kept.sum())
    if not count:
        nodes = aligned_zeros(8 * CHILDREN).reshape(1, 8, CHILDREN)
        nodes[:, :6] = np.float32(np.nan).view(np.uint32)
        return WideBvh(nodes, empty_blocks(1))
    draft = drafted(vertices, faces, kept, pool)
    wide, leaves = np.empty((count, 8, CHILDREN), np.uint32), np.empty((count, 3), np.int64)
    node_count, leaf_count, block_count = _collapse(draft, wide, wide.view(np.float32), leaves)
    nodes, blocks = aligned_zeros(8 * CHILDREN * node_count).reshape(-1, 8, CHILDREN), empty_blocks(block_count)
    nodes[:] = wide[:node_count]
    pool.run(lambda _, counter: fill_blocks(counter, vertices, faces, draft.order, leaves[:leaf_count], blocks))
    return WideBvh(nodes, blocks)


def drafted(
    vertices: NDArray[np.float32], faces: NDArray[np.uint32], kept: NDArray[np.bool_], pool: WorkerPool
) -> Draft:
    """The binary BVH of some triangles, at least one, under construction: all nodes are there."""
    order, triangles = np.flatnonzero(kept).astype(np.int32), np.empty((len(faces), 6), np.float32)
    pool.run(lambda _, counter: bound_triangles(counter, vertices, faces, triangles))
    count = len(order)
    draft = Draft(np.empty((2 * count, 6), np.float32), np.empty((2 * count, 3), np.int32), triangles, order)
    tasks = np.empty((_TASKS, 4), np.int64)
    shared = tasks[: split_top(draft, tasks, max(count // _TASKS, BLOCK))]
    pool.run(lambda _, counter: build_subtrees(counter, draft, shared))
    return draft


def empty_blocks(count: int) -> NDArray[np.uint32]:
    """(count, 10, BLOCK) uint32: blocks with NaN corners and prim_ids 0."""
    blocks = aligned_zeros(10 * BLOCK * count).reshape(-1, 10, BLOCK)
    blocks.view(np.float32)[:, :9] = np.nan
    return blocks


def aligned_zeros(count: int) -> NDArray[np.uint32]:
    """A zeroed uint32 array that starts at a cache line."""
    memory = np.zeros(4 * count + _CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % _CACHE_LINE
    return memory[start : start + 4 * count].view(np.uint32)


@kernel
def _collapse(draft, wide, wide_floats, leaves):  # type: ignore[no-untyped-def]
    """Write the wide nodes, the root first; returns the numbers of nodes, leaves and blocks. A member with the largest
    box is opened first.

    leaves: (T, 3) int64: first position, triangles and first block.
    """
    boxes, links = draft.boxes, draft.links
    stack = np.empty((_DEEPEST * CHILDREN, 2), np.int64)
    members = np.empty(CHILDREN, np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, used, leaf, block = 1, 1, 0, 0
    while top > 0:
        top -= 1
        node, place = stack[top, 0], stack[top, 1]
        members[0] = node
        count = 1
        while count < CHILDREN:
            best, largest = -1, -1.0
            for k in range(count):
                one = members[k]
                if links[one, 1] == 0:
                    x = np.float64(boxes[one, 3]) - boxes[one, 0]
                    y = np.float64(boxes[one, 4]) - boxes[one, 1]
                    z = np.float64(boxes[one, 5]) - boxes[one, 2]
                    area = x * y + y * z + z * x
                    if area > largest:
                        best, largest = k, area
            if best < 0:
                break
            first = np.int64(links[members[best], 0])
            members[best], members[count] = first, first + 1
            count += 1
        for k in range(CHILDREN):
            for row in range(6):
                wide_floats[place, row, k] = boxes[members[k], row] if k < count else np.nan
            wide[place, 6, k], wide[place, 7, k] = 0, 0
            if k >= count:
                continue
            triangles = np.int64(links[members[k], 1])
            if triangles:
                blocks = (triangles + BLOCK - 1) // BLOCK
                wide[place, 6, k], wide[place, 7, k] = block, blocks
                leaves[leaf, 0], leaves[leaf, 1], leaves[leaf, 2] = links[members[k], 0], triangles, block
                leaf += 1
                block += blocks
            else:
                wide[place, 6, k] = used
                stack[top, 0], stack[top, 1] = members[k], used
                top += 1
                used += 1
    return used, leaf, block
