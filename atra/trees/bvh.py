"""A binary BVH over a mesh, built by the surface area heuristic (SAH), as arrays that Numba kernels traverse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.trees.building import Draft, bound_triangles, build_subtrees, fill_blocks, lay_out, split_top
from atra.trees.layout import BIAS, BLOCK, Tree

_CACHE_LINE = 64
_TASKS = 64
"""Subtrees that the build threads share; many more than threads, so that all stay busy."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """A binary BVH of triangles.

    nodes: (N, 8) uint32 and blocks: (B, 10, 4) uint32, laid out as in `atra.trees.layout` and aligned to cache lines.
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

    @property
    def axes(self) -> NDArray[np.int64]:
        """(N,) int64: the split axis of an inner node; its second child lies higher along it."""
        return (self.nodes[:, 7].astype(np.int64) - BIAS) & 3

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
    order = np.flatnonzero(kept).astype(np.int32)
    if not len(order):
        return _empty_bvh()
    triangles = np.empty((len(faces), 6), np.float32)
    pool.run(lambda _, counter: bound_triangles(counter, vertices, faces, triangles))
    count = len(order)
    draft = Draft(np.empty((2 * count, 6), np.float32), np.empty((2 * count, 3), np.int32), triangles, order)
    tasks = np.empty((_TASKS, 4), np.int64)
    shared = tasks[: split_top(draft, tasks, max(count // _TASKS, BLOCK))]
    pool.run(lambda _, counter: build_subtrees(counter, draft, shared))
    drafted, leaves = np.zeros((2 * count, 8), np.uint32), np.empty((count, 3), np.int64)
    node_count, leaf_count, block_count = lay_out(draft, drafted, leaves)
    nodes, blocks = _lines(8 * node_count).reshape(-1, 8), _lines(10 * BLOCK * block_count).reshape(-1, 10, BLOCK)
    nodes[:] = drafted[:node_count]
    _leave_empty(blocks)
    pool.run(lambda _, counter: fill_blocks(counter, vertices, faces, order, leaves[:leaf_count], blocks))
    return Bvh(nodes, blocks, count)


def _empty_bvh() -> Bvh:
    """One far-away leaf without triangles."""
    nodes, blocks = _lines(16).reshape(2, 8), _lines(10 * BLOCK).reshape(1, 10, BLOCK)
    _leave_empty(blocks)
    nodes.view(np.float32)[0] = 1e30
    nodes[0, 3], nodes[0, 7] = BIAS, BIAS + 4
    return Bvh(nodes, blocks, 0)


def _leave_empty(blocks: NDArray[np.uint32]) -> None:
    """Fill all entries with NaN corners; prim_ids stay 0."""
    blocks.view(np.float32)[:, :9] = np.nan


def _lines(count: int) -> NDArray[np.uint32]:
    """A zeroed uint32 array that starts at a cache line."""
    memory = np.zeros(4 * count + _CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % _CACHE_LINE
    return memory[start : start + 4 * count].view(np.uint32)
