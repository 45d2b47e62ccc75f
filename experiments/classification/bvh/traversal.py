"""Rays through a BVH, in all threads of a pool."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from experiments.classification.bvh.batches import Batch, Memory, batch_kernel
from experiments.classification.bvh.binary import Bvh
from experiments.classification.bvh.starts import NO_SHAFTS, Shafts
from experiments.classification.options import BvhOptions


class Traversal:
    """What traces batches through a BVH, and each thread's memory."""

    def __init__(self, bvh: Bvh, options: BvhOptions, pool: WorkerPool) -> None:
        self.bvh, self._pool, self._is_push = bvh, pool, options.traversal == "push"
        self._memories = [Memory.new() for _ in range(pool.threads)]

    def trace(
        self, batch: Batch, shafts: Shafts, t: NDArray[np.float32], prim_id: NDArray[np.uint32],
        any_hit: bool = False, counting: bool = False,
    ) -> NDArray[np.int64]:  # fmt: skip
        """Trace a batch; returns the counters of `bvh.single`, (COUNTS,) int64, 0 unless counting, which is slower.

        shafts: whose lists rays start from; NO_SHAFTS: at the root. t: (N,) float32, in lengths of the direction, and
        prim_id: (N,) uint32; written. any_hit: any hit will do, and t is undefined.
        """
        kernel = batch_kernel(self._is_push, any_hit, counting, shafts is not NO_SHAFTS)
        tree = self.bvh.tree
        for memory in self._memories:
            memory.counts[:] = 0

        def work(worker: int, counter: int) -> None:
            kernel(counter, tree, batch, shafts, t, prim_id, self._memories[worker])

        self._pool.run(work)
        return np.sum([memory.counts for memory in self._memories], axis=0)
