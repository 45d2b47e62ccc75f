"""The BVH of a mesh: binary, by the surface area heuristic, in arrays that kernels of ours traverse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.bvh.building import Draft, bound_triangles, build_subtrees, fill_blocks, lay_out, split_top
from atra.bvh.layout import BIAS, BLOCK, Tree
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh

_CACHE_LINE = 64
_TASKS = 64
"""Subtrees that threads share out: enough for any number of them to be busy to the end, mostly."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """A binary BVH of triangles in some space.

    nodes: (N, 8) uint32 and blocks: (B, 10, 4) uint32, as `atra.bvh.layout` says, each from the start of a
    cache line on. triangle_count: triangles in it.
    """

    nodes: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    triangle_count: int

    @property
    def tree(self) -> Tree:
        """Where it begins in memory, for kernels; valid as long as this object lives."""
        return Tree(self.nodes.ctypes.data, self.blocks.ctypes.data)

    @property
    def bytes(self) -> int:
        """Memory of nodes and triangles."""
        return self.nodes.nbytes + self.blocks.nbytes

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64, lowest and highest corner of everything."""
        return self.boxes[0].astype(np.float64)

    @property
    def is_left_over(self) -> NDArray[np.bool_]:
        """(B, 4) bool, places of blocks that hold no triangle."""
        return np.isnan(self.blocks[:, 0].view(np.float32))

    @property
    def boxes(self) -> NDArray[np.float32]:
        """(N, 2, 3) float32, lowest and highest corner of every node; of node 1, which is none, without meaning."""
        return self.nodes.view(np.float32).reshape(-1, 2, 4)[:, :, :3]

    @property
    def first(self) -> NDArray[np.int64]:
        """(N,) int64, the first child of an inner node, the first block of a leaf."""
        return self.nodes[:, 3].astype(np.int64) - BIAS

    @property
    def block_counts(self) -> NDArray[np.int64]:
        """(N,) int64, blocks of a leaf, 0 of an inner node."""
        return (self.nodes[:, 7].astype(np.int64) - BIAS) >> 2

    @property
    def axes(self) -> NDArray[np.int64]:
        """(N,) int64, along which an inner node's second child is the higher one."""
        return (self.nodes[:, 7].astype(np.int64) - BIAS) & 3

    @cached_property
    def heights(self) -> NDArray[np.int64]:
        """(N,) int64, levels below a node; 0 of a leaf."""
        heights = np.zeros(len(self.nodes), np.int64)
        inner, first = np.flatnonzero(self.block_counts == 0), self.first
        for node in inner[inner != 1][::-1]:  # children come after their parents
            heights[node] = 1 + heights[first[node] : first[node] + 2].max()
        return heights


def bvh_of(mesh: Mesh, vertices: NDArray[np.float32], pool: WorkerPool, unseen: NDArray[np.int64] | None = None) -> Bvh:
    """The BVH of the triangles of a mesh but those that are unseen, (N,) `prim_id`; None: those without area. Vertices
    lie where `vertices`, (V, 3) float32, says."""
    kept = np.ones(mesh.triangle_count, np.bool_)
    kept[mesh.without_area if unseen is None else unseen] = False
    return build_bvh(vertices, mesh.traced_faces, kept, pool)


def build_bvh(
    vertices: NDArray[np.float32], faces: NDArray[np.uint32], kept: NDArray[np.bool_], pool: WorkerPool
) -> Bvh:
    """The BVH of those triangles whose number is `kept`; the same to the bit for any number of threads.

    vertices: (V, 3) float32, faces: (F, 3) uint32, kept: (F,) bool. Without any triangle it is one that nothing hits.
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
    """A leaf far away with no triangle."""
    nodes, blocks = _lines(16).reshape(2, 8), _lines(10 * BLOCK).reshape(1, 10, BLOCK)
    _leave_empty(blocks)
    nodes.view(np.float32)[0] = 1e30
    nodes[0, 3], nodes[0, 7] = BIAS, BIAS + 4
    return Bvh(nodes, blocks, 0)


def _leave_empty(blocks: NDArray[np.uint32]) -> None:
    """NaN for corners, in all places; prim_ids are 0."""
    blocks.view(np.float32)[:, :9] = np.nan


def _lines(count: int) -> NDArray[np.uint32]:
    """So many zeroed numbers, from a cache line's start on."""
    memory = np.zeros(4 * count + _CACHE_LINE, np.uint8)
    start = -memory.ctypes.data % _CACHE_LINE
    return memory[start : start + 4 * count].view(np.uint32)
