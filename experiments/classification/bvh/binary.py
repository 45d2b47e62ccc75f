"""Binary BVHs: nodes of half a cache line, and the blocks of triangles that the library's own trees have."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import int32_at
from atra.compiled.store import kernel, njit
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.trees.building import fill_blocks
from atra.trees.layout import BLOCK, DEEPEST
from atra.trees.wide import aligned_zeros, drafted, empty_blocks

NODE_BYTES = 32
"""A node: lowest corner, first child or block, highest corner, kind; 4 bytes each. Siblings share a cache line."""

FIRST, KIND = 12, 28
"""Byte offsets of a node's first child or block, and of its kind: the split axis, plus 4 times the number of blocks of
a leaf."""

BIAS = 1 << 23
"""Added to both integers: box tests read them as floats and drop the result, and denormal floats are slow."""

ROOT = 0
"""The root's number. Node 1 stays unused, so that pairs of siblings are aligned to cache lines."""

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


@dataclass(frozen=True, eq=False)
class Bvh:
    """A binary BVH of triangles.

    nodes: (N, 8) uint32 and blocks: (B, 10, 4) uint32, laid out as said above and aligned to cache lines.
    triangle_count: triangles in the BVH.
    """

    nodes: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    triangle_count: int

    @property
    def tree(self) -> Tree:
        """Addresses for kernels; valid while this object lives."""
        return Tree(self.nodes.ctypes.data, self.blocks.ctypes.data)

    @property
    def bytes(self) -> int:
        """Memory of nodes and blocks."""
        return self.nodes.nbytes + self.blocks.nbytes

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64, lowest and highest corner of the root's box."""
        return self.boxes[0].astype(np.float64)

    @property
    def is_left_over(self) -> NDArray[np.bool_]:
        """(B, 4) bool: block entries that hold no triangle."""
        return np.isnan(self.blocks[:, 0].view(np.float32))

    @property
    def boxes(self) -> NDArray[np.float32]:
        """(N, 2, 3) float32, lowest and highest corner of every node's box. Node 1 is unused."""
        return self.nodes.view(np.float32).reshape(-1, 2, 4)[:, :, :3]

    @property
    def first(self) -> NDArray[np.int64]:
        """(N,) int64: the first child of an inner node, the first block of a leaf."""
        return self.nodes[:, 3].astype(np.int64) - BIAS

    @property
    def block_counts(self) -> NDArray[np.int64]:
        """(N,) int64: blocks of a leaf, 0 for an inner node."""
        return (self.nodes[:, 7].astype(np.int64) - BIAS) >> 2

    @cached_property
    def heights(self) -> NDArray[np.int64]:
        """(N,) int64: levels below a node; 0 for a leaf."""
        heights = np.zeros(len(self.nodes), np.int64)
        inner, first = np.flatnonzero(self.block_counts == 0), self.first
        for node in inner[inner != 1][::-1]:  # children come after their parents
            heights[node] = 1 + heights[first[node] : first[node] + 2].max()
        return heights


def bvh_of(mesh: Mesh, vertices: NDArray[np.float32], pool: WorkerPool, unseen: NDArray[np.int64] | None = None) -> Bvh:
    """The BVH of a mesh without its `unseen` triangles, (N,) prim_ids; None leaves out those without area. vertices:
    (V, 3) float32, in place of the mesh's own."""
    kept = np.ones(mesh.triangle_count, np.bool_)
    kept[mesh.without_area if unseen is None else unseen] = False
    return build_bvh(vertices, mesh.traced_faces, kept, pool)


def build_bvh(
    vertices: NDArray[np.float32], faces: NDArray[np.uint32], kept: NDArray[np.bool_], pool: WorkerPool
) -> Bvh:
    """The BVH of the triangles selected by `kept`. The same to the bit for any number of threads.

    vertices: (V, 3) float32. faces: (F, 3) uint32. kept: (F,) bool. Without triangles it is a BVH that no ray hits.
    """
    count = int(kept.sum())
    if not count:
        return _empty_bvh()
    draft = drafted(vertices, faces, kept, pool)
    laid_out, leaves = np.zeros((2 * count, 8), np.uint32), np.empty((count, 3), np.int64)
    node_count, leaf_count, block_count = lay_out(draft, laid_out, leaves)
    nodes, blocks = aligned_zeros(8 * node_count).reshape(-1, 8), empty_blocks(block_count)
    nodes[:] = laid_out[:node_count]
    pool.run(lambda _, counter: fill_blocks(counter, vertices, faces, draft.order, leaves[:leaf_count], blocks))
    return Bvh(nodes, blocks, count)


def _empty_bvh() -> Bvh:
    """One far-away leaf without triangles."""
    nodes = aligned_zeros(16).reshape(2, 8)
    nodes.view(np.float32)[0] = 1e30
    nodes[0, 3], nodes[0, 7] = BIAS, BIAS + 4
    return Bvh(nodes, empty_blocks(1), 0)


@kernel
def lay_out(draft, nodes, leaves):  # type: ignore[no-untyped-def]
    """Copy the nodes in traversal order; returns the numbers of nodes, leaves and blocks.

    nodes: (>= 2 T, 8) uint32. leaves: (T, 3) int64: first position, triangles and
    first block.
    """
    floats = nodes.view(np.float32)
    stack = np.empty((DEEPEST + 2, 2), np.int64)
    stack[0, 0], stack[0, 1] = 0, 0
    top, used, leaf, block = 1, 2, 0, 0
    while top > 0:
        top -= 1
        old, new = stack[top, 0], stack[top, 1]
        for axis in range(3):
            floats[new, axis], floats[new, 4 + axis] = draft.boxes[old, axis], draft.boxes[old, 3 + axis]
        first, count, direction = draft.links[old, 0], draft.links[old, 1], draft.links[old, 2]
        if count:
            blocks = (count + BLOCK - 1) // BLOCK
            leaves[leaf, 0], leaves[leaf, 1], leaves[leaf, 2] = first, count, block
            nodes[new, 3], nodes[new, 7] = BIAS + block, BIAS + 4 * blocks
            leaf += 1
            block += blocks
        else:
            nodes[new, 3], nodes[new, 7] = BIAS + used, BIAS + direction
            stack[top, 0], stack[top, 1] = first + 1, used + 1
            top += 1
            stack[top, 0], stack[top, 1] = first, used
            top += 1
            used += 2
    return used, leaf, block
