"""What kernels of rays get and fill: batches, trees, lists, and the memory of a thread; and the sizes of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.instruction_sets import native_lanes
from atra.trees.layout import DEEPEST
from atra.trees.wide import CHILDREN

LEAF = 1
"""Added to the address of a block on the stack; nodes and blocks lie at even addresses."""

CHUNK = 256
"""Rays a thread takes at a time."""

LEAVES = 64
"""Leaves that a ray enters before their triangles are tested."""

RAY_LANES = 16 if native_lanes() == 16 else 8
"""Rays whose nearest hits are found together."""

LANE_ROWS = 20
"""Rows of memory of a thread for such rays, a float64 of each."""

STACK = CHILDREN * (DEEPEST + 4)
"""Nodes that wait to be visited, at most."""

WORKER_SHIFT = 40
"""Bits of a ray's place in its thread's memory; the thread's number stands above them."""


class TreeAddresses(NamedTuple):
    """Addresses of nodes, blocks, and the mesh's vertices and faces, and the sphere around it: its middle and radius,
    float64."""

    nodes: int
    blocks: int
    vertices: int
    faces: int
    sphere: tuple[float, float, float, float]


class Found(NamedTuple):
    """Hits that one thread has found, ray by ray, in memory for `len(t)` of them.

    t: (M,) float64. prim_id: (M,) uint32. u, v: (M,) float32. used: (1,) int64, hits so far. stack: (STACK,) int64.
    reached: (STACK,) float32, where the ray comes to these nodes. exact: (PARTS,) float64. areas: (AREAS,) float64.
    entries: (CHILDREN,) float32. entered, remaining: (LEAVES,) int64, leaves that wait to be tested: next block and
    blocks. nodes, leaves: (MOST_NODES,) int64, of `find_together`. lanes: (LANE_ROWS, RAY_LANES) float64 and
    hit_places: (RAY_LANES,) int64, of `hit_together`.
    """

    t: NDArray[np.float64]
    prim_id: NDArray[np.uint32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    used: NDArray[np.int64]
    stack: NDArray[np.int64]
    reached: NDArray[np.float32]
    exact: NDArray[np.float64]
    areas: NDArray[np.float64]
    entries: NDArray[np.float32]
    entered: NDArray[np.int64]
    remaining: NDArray[np.int64]
    nodes: NDArray[np.int64]
    leaves: NDArray[np.int64]
    lanes: NDArray[np.float64]
    hit_places: NDArray[np.int64]


class Lists(NamedTuple):
    """What is known of each ray. done: (chunks,) int64, rays of a chunk that are finished. counts: (N,) int32, hits
    kept. places: (N,) int64, thread and place of the first, or the sum of the signs of hits that are only counted.
    truncated: (N,) bool, there are more."""

    done: NDArray[np.int64]
    counts: NDArray[np.int32]
    places: NDArray[np.int64]
    truncated: NDArray[np.bool_]
