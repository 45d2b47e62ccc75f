"""The shafts of a BVH: their resolution and their lists."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import InputError, MemoryBudgetError
from atra.tracing.budgets import check_needed_bytes
from experiments.classification.bvh.batches import Memory
from experiments.classification.bvh.binary import Bvh
from experiments.classification.bvh.starts import FIRST_LIST, MOST, NO_LISTS, ROOT_LIST, UNKNOWN, Grid, Shafts
from experiments.classification.options import OF_RAYS, ClassifiedOptions
from experiments.classification.shafts.lists_kernels import (
    LANES,
    ROWS,
    Building,
    Sampling,
    build_lists,
    mark_voxels,
    store_lists,
)
from experiments.classification.shafts.shape_kernels import SHAPE

FARTHEST = 8.0
"""Largest coordinate of an origin that is classified, as a multiple of the box's; farther out, rounding approaches the
slack."""

LEAST_BYTES = 1 << 16
"""Memory of lists and look-up that is always allowed: the BVH of a few triangles is smaller than the shafts of one
voxel."""

_AT_ONCE = 1 << 14
_LIKELY_BYTES = 40
"""Assumed memory of a shaft, where the search for the resolution starts."""

_ATTEMPTS, _ENOUGH = 5, 0.7
"""Number of finer resolutions that the search tries, and the fraction of the budget that ends it."""


@dataclass(frozen=True, eq=False)
class ShaftLists:
    """Shafts with their lists, and statistics of them.

    shafts: for kernels. bvh: which the nodes belong to. count: shafts, with or without a list. built: shafts with a
    list. lists_unique: stored lists, without the empty one. lengths: (built,) int32, of each shaft's list.
    build_time_s: seconds, finding the resolution included.
    """

    shafts: Shafts
    bvh: Bvh
    count: int
    built: int
    lists_unique: int
    lengths: NDArray[np.int32]
    build_time_s: float

    @property
    def lookup_bytes(self) -> int:
        """Memory of the tables that find a shaft's list."""
        return self.shafts.rows.nbytes + self.shafts.table.nbytes

    @property
    def list_bytes(self) -> int:
        """Memory of the lists."""
        return self.shafts.lists.nbytes

    @property
    def entry_height_mean(self) -> float:
        """Mean height of the subtrees in the stored lists."""
        lists, heights, place, total, entries = self.shafts.lists, self.bvh.heights, FIRST_LIST, 0, 0
        while place < len(lists):
            length = int(lists[place])
            total += int(heights[lists[place + 1 : place + 1 + length]].sum())
            entries += length
            place += 1 + length
        return total / entries if entries else 0.0

    @property
    def counters(self) -> Mapping[str, float]:
        """Numbers by name."""
        return {
            "shafts": self.count,
            "shafts_built": self.built,
            "lists_unique": self.lists_unique,
            "list_length_mean": float(self.lengths.mean()) if self.built else 0.0,
            "list_length_max": int(self.lengths.max()) if self.built else 0,
            "entry_height_mean": self.entry_height_mean,
            "root_height": int(self.bvh.heights[0]),
            "lookup_bytes": self.lookup_bytes,
            "list_bytes": self.list_bytes,
            "shaft_build_time_s": self.build_time_s,
        }


SLACK = 64.0
"""Margin of voxels in float32 spacings of the largest coordinate. Rounding of the tests of boxes and triangles moves a
ray whose origin lies within FARTHEST by less."""


def grid_of(bvh: Bvh, cells: int, directions: int) -> Grid:
    """Near-cubic voxels, at most `cells`, of the BVH's box; a single layer along axes on which it is thinner than a
    voxel. Raises InputError for MOST voxels or more.
    """
    low, high = bvh.bounds
    largest = float(np.abs(bvh.bounds).max())
    slack = SLACK * float(np.spacing(np.float32(largest)))
    low, high = low - slack, high + slack
    sides = high - low
    thick = np.ones(3, np.bool_)
    while True:
        mean = (sides[thick].prod() / cells) ** (1.0 / thick.sum())
        edge = min(mean, sides.max())  # rounding may exceed it; one axis must stay
        if (sides[thick] >= edge).all():
            break
        thick &= sides >= edge
    voxels = np.where(thick, np.maximum(1, (sides / edge).astype(np.int64)), 1)
    if int(voxels.prod()) >= MOST:
        raise InputError(f"cells is {cells:,}, which makes {int(voxels.prod()):,} voxels; expected fewer than {MOST:,}")
    size = sides / voxels
    return Grid(low, high, size, 1.0 / size, voxels, int(directions), slack, FARTHEST * largest)


def build_shafts(
    bvh: Bvh, options: ClassifiedOptions, pool: WorkerPool, grid: Grid | None = None,
    used: NDArray[np.int64] | None = None,
) -> ShaftLists:  # fmt: skip
    """Build the lists of the shafts that `options.shaft_subset` selects.

    grid: instead of the options' own. used: the shafts that get lists, for subsets that depend on rays; their grid has
    as many voxels as the memory probably allows. Raises MemoryBudgetError where a single voxel needs more than
    `options.shaft_memory` times the BVH's memory and LEAST_BYTES, or more than is free.
    """
    start, directions = perf_counter(), options.shaft_directions
    if grid is not None or options.shaft_cells is not None:
        grid = grid or grid_of(bvh, options.shaft_cells or 1, directions)
        return _lists(bvh, options, pool, grid, used, start)
    budget = max(options.shaft_memory * bvh.bytes, LEAST_BYTES)
    cells = min(max(int(budget / (_LIKELY_BYTES * 6 * directions**2)), 1), MOST // 2)
    too_many, best = MOST // 2 + 1, None
    if options.shaft_subset in (*OF_RAYS, "none"):
        return _lists(bvh, options, pool, grid_of(bvh, cells, directions), used, start)
    for attempt in count():
        lists = _lists(bvh, options, pool, grid_of(bvh, cells, directions), used, start)
        needed = lists.lookup_bytes + lists.list_bytes
        if needed <= budget and (best is None or needed > best.lookup_bytes + best.list_bytes):
            best = lists
        if best is not None and (attempt >= _ATTEMPTS or _ENOUGH * budget < needed <= budget):
            return replace(best, build_time_s=perf_counter() - start)
        if needed > budget and cells == 1:
            raise MemoryBudgetError(
                f"shafts of a single voxel with shaft_directions={directions} need {needed:,} bytes, and shaft_memory="
                f"{options.shaft_memory:g} allows {int(budget):,}; raise shaft_memory, or lower shaft_directions"
            )
        too_many = min(too_many, cells) if needed > budget else too_many
        cells = int(min(max(0.9 * budget / needed * cells, 1), max(too_many - 1, 1)))
    raise AssertionError("attempts do not end")


def _lists(
    bvh: Bvh, options: ClassifiedOptions, pool: WorkerPool, grid: Grid, used: NDArray[np.int64] | None, start: float
) -> ShaftLists:
    voxels, of_voxel = int(grid.voxels.prod()), 6 * grid.directions**2
    advice = "ask for fewer cells or directions"
    in_all = voxels * of_voxel if options.shaft_subset == "complete" else 0
    check_needed_bytes(5 * voxels + 8 * in_all, None, f"{voxels * of_voxel:,} shafts", advice)
    numbers = _numbers(bvh, options, pool, grid, used)
    has_row = np.zeros(voxels, np.bool_)
    has_row[numbers // of_voxel] = True
    row_count = int(has_row.sum())
    needed = 4 * (voxels + row_count * of_voxel) + 16 * len(numbers)
    check_needed_bytes(needed, None, f"{len(numbers):,} shafts", advice)
    rows = np.where(has_row, np.cumsum(has_row) - 1, UNKNOWN).astype(np.int32)
    table = np.full((row_count, of_voxel), ROOT_LIST, np.int32)
    starts, lengths, lists, unique = _stored_lists(bvh, options, pool, grid, numbers)
    table[rows[numbers // of_voxel], numbers % of_voxel] = starts
    shafts = Shafts(grid, rows, table, lists)
    return ShaftLists(shafts, bvh, voxels * of_voxel, len(numbers), unique, lengths, perf_counter() - start)


def _stored_lists(
    bvh: Bvh, options: ClassifiedOptions, pool: WorkerPool, grid: Grid, numbers: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.uint32], int]:
    """Where the list of each shaft starts and its length, (S,) int32; all lists, equal ones once; and their number."""
    longest = options.shaft_list
    building = Building(
        bvh.tree, grid, options.shaft_probability, options.shaft_rays, longest, options.shaft_occlusion
    )  # fmt: skip
    memories = [_sampling(options) for _ in range(pool.threads)]
    starts, lengths = np.empty((2, len(numbers)), np.int32)
    slots = np.full(1 << (2 * len(numbers) + 1).bit_length(), -1, np.int32)
    lists, stored = NO_LISTS, FIRST_LIST
    for first in range(0, len(numbers), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        some, own = numbers[part], lengths[part]
        nodes = np.empty((len(some), longest), np.uint32)
        written = some, own, nodes  # bound below, before the next part

        def work(worker: int, counter: int, written: Any = written) -> None:
            build_lists(counter, building, *written, memories[worker])

        pool.run(work)
        if len(lists) < stored + nodes.size + len(own):
            lists = np.concatenate([lists[:stored], np.empty(stored + nodes.size + len(own), np.uint32)])
        stored = store_lists(own, nodes, starts[part], lists, stored, slots)
    return starts, lengths, lists[:stored].copy(), int((slots >= 0).sum())


def _numbers(
    bvh: Bvh, options: ClassifiedOptions, pool: WorkerPool, grid: Grid, used: NDArray[np.int64] | None
) -> NDArray[np.int64]:
    """The shafts that have lists, ascending."""
    voxels, of_voxel = int(grid.voxels.prod()), 6 * grid.directions**2
    if options.shaft_subset in (*OF_RAYS, "none"):
        return np.empty(0, np.int64) if used is None else used
    if options.shaft_subset == "complete":
        return np.arange(voxels * of_voxel, dtype=np.int64)
    occupied, blocks = np.zeros(voxels, np.bool_), bvh.blocks.view(np.float32)
    pool.run(lambda _, counter: mark_voxels(counter, blocks, grid, occupied))
    return (np.flatnonzero(occupied)[:, None] * of_voxel + np.arange(of_voxel)).ravel()


def _sampling(options: ClassifiedOptions) -> Sampling:
    lanes = options.shaft_rays + -options.shaft_rays % LANES
    return Sampling(np.zeros(SHAPE), np.zeros((ROWS, lanes), np.float32), NO_LISTS, Memory.new())
