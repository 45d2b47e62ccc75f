"""Layout of a BVH in memory: nodes of half a cache line, and triangles in blocks of four."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import int32_at
from atra.compiled.store import njit

NODE_BYTES = 32
"""Lowest corner, first; highest corner, kind; four bytes each. Two nodes with one parent share a cache line."""

FIRST, KIND = 12, 28
"""Bytes from a node's start to the number of its first child or block, and to its kind: the axis along which its second
child is the higher one, and from bit 2 on, of a leaf, how many blocks it has; 0 of an inner node."""

BIAS = 1 << 23
"""Added to both. Tests of boxes read them as floats and drop the result; denormal ones take long to multiply."""

BLOCK = 4
"""Triangles tested at once by a single ray; places that are left over hold NaN, which no ray hits."""

BLOCK_BYTES = 40 * BLOCK
"""First, second and third corners, x y z each, and prim_ids: four of each side by side. Corners, not edges: what two
triangles share must be the same numbers for both, or rays slip through between them."""

IDS = 36 * BLOCK
"""Bytes from a block's start to its prim_ids."""

ROOT = 0
"""The root's number; its neighbour stays empty, so that pairs begin where cache lines do."""

DEEPEST = 60
"""Levels below the root; what would be deeper becomes a large leaf."""

STACK = 2 * DEEPEST + 8
"""Nodes that a traversal may have to remember."""


class Tree(NamedTuple):
    """What kernels are told of a BVH: where its nodes and blocks begin in memory."""

    nodes: int
    blocks: int


@njit(forceinline=True)
def first_of(node):  # type: ignore[no-untyped-def]
    """The first child of an inner node at an address, or the first block of a leaf."""
    return np.int64(int32_at(node + FIRST)) - BIAS


@njit(forceinline=True)
def kind_of(node):  # type: ignore[no-untyped-def]
    """The kind of the node at an address."""
    return np.int64(int32_at(node + KIND)) - BIAS
