"""Batches of rays against a mesh, each ray from the list of its shaft."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from experiments.classification.bvh.batches import Batch, classify
from experiments.classification.bvh.scene import BvhScene, PreparedRays
from experiments.classification.bvh.starts import AHEAD, AHEAD_ROWS, NO_SHAFTS
from experiments.classification.options import OF_RAYS, ClassifiedOptions
from experiments.classification.shafts.shafts import build_shafts

SAMPLE = 64
"""The subset "sampled" looks at one in SAMPLE rays of a batch."""


class ShaftScene(BvhScene):
    """A `BvhScene` in which each ray starts from the nodes in its shaft's list (ray classification).

    Subsets of shafts that depend on rays are built by `prepare`. Raises what `BvhScene` does, and MemoryBudgetError for
    shafts that do not fit. Source: J. Hendrich et al., "Ray classification for accelerated BVH traversal", 2019.
    """

    def __init__(self, mesh: Mesh, options: ClassifiedOptions, threads: int | None = None) -> None:
        super().__init__(mesh, options, threads)
        self._options = options
        start = perf_counter()
        self.lists = build_shafts(self.bvh, options, self._pool)
        self.build_time_s += perf_counter() - start

    @property
    def counters(self) -> Mapping[str, float]:
        """Numbers by name: of the BVH and of the shafts, those of the rays prepared last if they depend on rays."""
        return {**super().counters, **self.lists.counters}

    def prepare(self, rays: Rays) -> PreparedRays:
        """Find the shafts of rays where needed, build lists that depend on them, and order the rays."""
        start, options = perf_counter(), self._options
        batch, numbers, sampled_s = super().prepare(rays).batch, None, 0.0
        if options.shaft_subset in OF_RAYS:
            is_sampled = options.shaft_subset == "sampled"
            numbers = self.classified(batch, SAMPLE if is_sampled else 1)
            used = _most_used(numbers, options.shaft_share if is_sampled else 1.0)
            sampled_s = perf_counter() - start
            self.lists = build_shafts(self.bvh, options, self._pool, self.lists.shafts.grid, used)
            start = perf_counter()
            numbers = None if is_sampled else numbers
        if options.ray_order == "shaft":
            numbers = self.classified(batch) if numbers is None else numbers
            batch = batch._replace(order=np.argsort(numbers, kind="stable"))
        shafts = NO_SHAFTS if options.shaft_subset == "none" else self.lists.shafts
        return PreparedRays(rays, batch, shafts, sampled_s, perf_counter() - start)

    def classified(self, batch: Batch, step: int = 1) -> NDArray[np.int64]:
        """The shaft of every step-th ray, or UNKNOWN or PASSES; (N,) int64."""
        numbers, grid = np.empty(-(-len(batch.origins) // step), np.int64), self.lists.shafts.grid
        ahead = np.zeros((self.threads, AHEAD_ROWS, AHEAD), np.float32)
        self._pool.run(lambda worker, counter: classify(counter, batch, step, grid, numbers, ahead[worker]))
        return numbers


def _most_used(numbers: NDArray[np.int64], share: float) -> NDArray[np.int64]:
    """The fewest shafts that together hold this share of the rays; ascending."""
    shafts, rays = np.unique(numbers[numbers >= 0], return_counts=True)
    if not len(shafts):
        return shafts
    order = np.argsort(-rays, kind="stable")
    enough = int(np.searchsorted(np.cumsum(rays[order]), share * rays.sum())) + 1
    return np.sort(shafts[order[:enough]])
