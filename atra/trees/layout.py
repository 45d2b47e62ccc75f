"""Memory layout of a BVH: nodes of half a cache line, triangles in blocks of four."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import int32_at
from atra.compiled.store import njit

NODE_BYTES = 32
"""A node: lowest corner, first child or block, highest corner, kind; 4 bytes each. Siblings share a cache line."""

FIRST, KIND = 12, 28
"""Byte offsets of a node's first child or block, and of its kind: the split axis, plus 4 times the number of blocks of
a leaf."""

BIAS = 1 << 23
"""Added to both integers: box tests read them as floats and drop the result, and denormal floats are slow."""

BLOCK = 4
"""Triangles that a single ray tests at once. Unused entries hold NaN, which no ray hits."""

BLOCK_BYTES = 40 * BLOCK
"""A block: x, y, z of the first, second and third corners, then prim_ids, four triangles side by side. It stores
corners rather than edges, so that neighbours share the same numbers and no ray slips through between them."""

IDS = 36 * BLOCK
"""Byte offset of a block's prim_ids."""

ROOT = 0
"""The root's number. Node 1 stays unused, so that pairs of siblings are aligned to cache lines."""

DEEPEST = 60
"""Maximum depth; deeper subtrees become large leaves."""

STACK = 2 * DEEPEST + 8
"""Entries of a traversal stack."""


class Tree(NamedTuple):
    """Addresses of a BVH's nodes and blocks."""

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
