"""What kernels of rays get and fill: trees, hits, and the memory of a thread; and the sizes of these."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.instruction_sets import native_lanes
from atra.exact.lines_kernels import PARTS
from atra.rays.tree.crossings_kernels import AREAS
from atra.trees.layout import DEEPEST
from atra.trees.wide import CHILDREN

CHUNK = 256
"""Rays a thread takes at a time."""

RAY_LANES = 16 if native_lanes() == 16 else 8
"""Rays that go through the tree together."""

LANE_ROWS = 20
"""Rows of memory of a thread for such rays, a float64 of each."""

STACK = CHILDREN * (DEEPEST + 4)
"""Nodes and leaves that wait to be visited, at most."""

MOST_LEAVES = 512
"""Leaves that rays may enter together to find all their hits; rays that enter more go alone."""

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


class Memory(NamedTuple):
    """Addresses of a thread's memory. A kernel that is given arrays in their place takes longer to call a function than
    that takes to visit a node.

    stack: (STACK,) int64, nodes and leaves that wait. reached: (STACK,) float32, where rays come to these. entries:
    (CHILDREN,) float32. exact: (PARTS,) float64. areas: (AREAS,) float64. lanes: (LANE_ROWS, RAY_LANES) float64 and
    places: (RAY_LANES,) int64, of rays that go together. leaves, noted, marks: (MOST_LEAVES,) int64, leaves
    that wait to be met, and those of `find_together`.
    """

    stack: int
    reached: int
    entries: int
    exact: int
    areas: int
    lanes: int
    places: int
    leaves: int
    noted: int
    marks: int


_WORDS = Memory(
    stack=STACK, reached=STACK // 2, entries=CHILDREN // 2, exact=PARTS, areas=AREAS, lanes=LANE_ROWS * RAY_LANES,
    places=RAY_LANES, leaves=MOST_LEAVES, noted=MOST_LEAVES, marks=MOST_LEAVES,
)  # fmt: skip
"""Numbers of 8 bytes that each takes."""


def thread_memory() -> tuple[NDArray[np.float64], Memory]:
    """Memory of a thread, and its addresses."""
    array, starts = aligned_empty((sum(_WORDS),), np.float64), np.cumsum((0, *_WORDS))[:-1]
    return array, Memory(*(array.ctypes.data + 8 * starts).tolist())


class Hits(NamedTuple):
    """Hits that one thread has found, ray by ray, in memory for `len(t)` of them.

    t: (M,) float64. prim_id: (M,) uint32. u, v: (M,) float32. used: (1,) int64, hits so far.
    """

    t: NDArray[np.float64]
    prim_id: NDArray[np.uint32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    used: NDArray[np.int64]


class Lists(NamedTuple):
    """What is known of each ray. done: (chunks,) int64, rays of a chunk that are finished. counts: (N,) int32, hits
    kept. places: (N,) int64, thread and place of the first, or the sum of the signs of hits that are only counted.
    truncated: (N,) bool, there are more."""

    done: NDArray[np.int64]
    counts: NDArray[np.int32]
    places: NDArray[np.int64]
    truncated: NDArray[np.bool_]
