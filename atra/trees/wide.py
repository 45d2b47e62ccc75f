"""A BVH of eight children per node, collapsed from a binary one; all boxes of a node are tested at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import kernel
from atra.trees.bvh import Bvh
from atra.trees.layout import BIAS

CHILDREN = 8

WIDE_BYTES = 32 * CHILDREN
"""A node: lowest x of its children's boxes, y, z, highest x, y, z; then first child or block, then the number of blocks
of a leaf, 0 of an inner node; 4 bytes each. Unused children have NaN boxes, which no ray enters."""

HIGH, FIRSTS, BLOCK_COUNTS = 12 * CHILDREN, 24 * CHILDREN, 28 * CHILDREN
"""Byte offsets of the highest corners, the first children and the numbers of blocks."""

_DEEPEST = 64


@dataclass(frozen=True, eq=False)
class WideBvh:
    """nodes: (N, 8, 8) uint32 and blocks: (B, 10, 4) uint32, laid out as said above and in `atra.trees.layout`."""

    nodes: NDArray[np.uint32]
    blocks: NDArray[np.uint32]

    @property
    def bytes(self) -> int:
        """Memory of nodes and blocks."""
        return self.nodes.nbytes + self.blocks.nbytes


def widened_bvh(bvh: Bvh) -> WideBvh:
    """The same triangles in a tree of eight children per node."""
    inner = int((bvh.block_counts == 0).sum())
    wide = np.empty((max(inner, 1), 8, CHILDREN), np.uint32)
    count = _collapse(bvh.nodes, bvh.nodes.view(np.float32), wide, wide.view(np.float32))
    memory = np.empty(count * WIDE_BYTES + 64, np.uint8)
    start = -memory.ctypes.data % 64
    nodes = memory[start : start + count * WIDE_BYTES].view(np.uint32).reshape(count, 8, CHILDREN)
    nodes[:] = wide[:count]
    return WideBvh(nodes, bvh.blocks)


@kernel
def _collapse(nodes, floats, wide, wide_floats):  # type: ignore[no-untyped-def]
    """Write the wide nodes, the root first; returns their number. A member with the largest box is opened first."""
    stack = np.empty((_DEEPEST * CHILDREN, 2), np.int64)
    members = np.empty(CHILDREN, np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, used = 1, 1
    while top > 0:
        top -= 1
        node, place = stack[top, 0], stack[top, 1]
        members[0] = node
        count = 1
        while count < CHILDREN:
            best, largest = -1, -1.0
            for k in range(count):
                one = members[k]
                if (nodes[one, 7] - BIAS) >> 2 == 0:
                    x = np.float64(floats[one, 4]) - floats[one, 0]
                    y = np.float64(floats[one, 5]) - floats[one, 1]
                    z = np.float64(floats[one, 6]) - floats[one, 2]
                    area = x * y + y * z + z * x
                    if area > largest:
                        best, largest = k, area
            if best < 0:
                break
            first = np.int64(nodes[members[best], 3]) - BIAS
            members[best], members[count] = first, first + 1
            count += 1
        for k in range(CHILDREN):
            for axis in range(3):
                wide_floats[place, axis, k] = floats[members[k], axis] if k < count else np.nan
                wide_floats[place, 3 + axis, k] = floats[members[k], 4 + axis] if k < count else np.nan
            wide[place, 6, k], wide[place, 7, k] = 0, 0
            if k < count:
                blocks = (np.int64(nodes[members[k], 7]) - BIAS) >> 2
                wide[place, 7, k] = blocks
                if blocks:
                    wide[place, 6, k] = np.int64(nodes[members[k], 3]) - BIAS
                else:
                    wide[place, 6, k] = used
                    stack[top, 0], stack[top, 1] = members[k], used
                    top += 1
                    used += 1
    return used
