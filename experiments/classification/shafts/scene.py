"""Batches of rays against a mesh, each ray from the list of its shaft."""

from __future__ import annotations

from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from experiments.classification.bvh.batches import classify
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.scene import BvhScene, PreparedRays, batch_of
from experiments.classification.bvh.starts import EMPTY_LIST, NO_SHAFTS, PASSES, ROOT_LIST, UNKNOWN, Shafts
from experiments.classification.shafts.options import OF_RAYS, ShaftOptions
from experiments.classification.shafts.shafts import HasShafts, build_shafts

SAMPLE = 64
"""The subset "sampled" looks at one in SAMPLE rays of a batch."""


class ShaftScene(HasShafts, BvhScene):
    """A `BvhScene` in which each ray starts from the nodes in its shaft's list (ray classification).

    options: see `ShaftOptions`. `build` builds the lists; subsets that depend on rays are built by `prepare`. Raises
    what `BvhScene` does, and MemoryBudgetError, when building, for shafts that do not fit. Source: J. Hendrich et al.,
    "Ray classification for accelerated BVH traversal", 2019.
    """

    options_type: ClassVar[type[BvhOptions]] = ShaftOptions

    def __init__(self, mesh: Mesh, **options: Any) -> None:
        self._set_up(mesh, options)

    def prepare(self, rays: Rays) -> PreparedRays:
        """Find the shafts of rays where needed, build lists that depend on them, and order the rays."""
        with self._in_use():
            start, given, rays = perf_counter(), rays, self._own(rays)
            batch, options = batch_of(rays, self.packet_width), self.options
            numbers, sampled_s = None, 0.0
            if options.subset in OF_RAYS:
                step = SAMPLE if options.subset == "sampled" else 1
                few = Rays(rays.origins[::step], rays.directions[::step], rays.tnear[::step], rays.tfar[::step])
                numbers = self._classified(batch_of(few, 1))
                used = _most_used(numbers, options.share if options.subset == "sampled" else 1.0)
                sampled_s = perf_counter() - start
                self._lists = build_shafts(self.bvh, options, self._pool, self.lists.shafts.grid, used)
                start = perf_counter()
                numbers = numbers if step == 1 else None
            shafts = self.lists.shafts
            if options.ray_order == "shaft" or self.packet_width > 1:
                numbers = self._classified(batch) if numbers is None else numbers
                batch = self._in_packets(rays, numbers, shafts)
            if options.subset == "none":
                shafts = NO_SHAFTS
            return PreparedRays(rays, batch, shafts, sampled_s, perf_counter() - start, given)

    def _classified(self, batch: Any) -> NDArray[np.int64]:
        numbers, grid = np.empty(len(batch.origins), np.int64), self.lists.shafts.grid
        self._pool.run(lambda worker, counter: classify(counter, batch, grid, numbers, self._memories[worker].ahead))
        return numbers

    def _in_packets(self, rays: Rays, numbers: NDArray[np.int64], shafts: Shafts) -> Any:
        """Order rays into packets that share a list; without lists, into full packets."""
        width = self.packet_width
        order = np.argsort(numbers, kind="stable") if self.options.ray_order == "shaft" else np.arange(len(numbers))
        if self.options.subset == "none":
            return batch_of(rays, width, order)
        lists = _lists_of(shafts, numbers[order])
        changes = np.flatnonzero(np.diff(lists)) + 1
        runs = np.concatenate([[0], changes]).astype(np.int64)
        lengths = np.diff(np.append(runs, len(lists)))
        packets = -(-lengths // width)
        first = np.repeat(np.cumsum(packets) - packets, packets)
        starts = np.repeat(runs, packets) + (np.arange(packets.sum()) - first) * width
        return batch_of(rays, width, order, starts, lists[starts])


def _lists_of(shafts: Shafts, numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """`bvh.starts.list_of` for many shafts."""
    of_voxel = 6 * shafts.grid.directions**2
    known = numbers >= 0
    rows = np.where(known, shafts.rows[np.where(known, numbers, 0) // of_voxel], UNKNOWN)
    found = np.full(len(numbers), ROOT_LIST, np.int64)
    has_row = rows >= 0
    found[has_row] = shafts.table[rows[has_row], numbers[has_row] % of_voxel]
    if shafts.empty_is_miss:
        found[numbers == PASSES] = EMPTY_LIST
    return found


def _most_used(numbers: NDArray[np.int64], share: float) -> NDArray[np.int64]:
    """The fewest shafts that together hold this share of the rays; ascending."""
    shafts, rays = np.unique(numbers[numbers >= 0], return_counts=True)
    if not len(shafts):
        return shafts
    order = np.argsort(-rays, kind="stable")
    enough = int(np.searchsorted(np.cumsum(rays[order]), share * rays.sum())) + 1
    return np.sort(shafts[order[:enough]])
