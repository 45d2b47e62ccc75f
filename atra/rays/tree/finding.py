"""Hits of rays by our own tree, batch by batch: memory of threads grows where all hits need it, and nothing is left
out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import MemoryBudgetError
from atra.geometry.mesh import Mesh
from atra.rays.order import Numbers, RayOrder, plan_of
from atra.rays.rays import Rays
from atra.rays.rays_kernels import RayBatch, batch_of
from atra.rays.tree.all_hits_kernels import all_hits_kernel, lay_out
from atra.rays.tree.memory import CHUNK, Hits, Lists, TreeAddresses, thread_memory
from atra.rays.tree.nearest_kernels import nearest_kernel
from atra.tracing.budgets import check_needed_bytes
from atra.trees.wide import WideBvh, wide_bvh

FEWEST_TRIANGLES = 1 << 15
"""Smallest mesh whose rays are put in order; a smaller one fits the cache anyway."""

BATCH = 1 << 16
"""Rays traced at a time; Ctrl-C is heard between batches."""

MOST = 1 << 30
"""More hits than a ray can have."""

_START, _KEPT = 1 << 16, 1 << 22
"""Hits that a thread's memory holds at first, and those it may hold after a call."""

_HIT_BYTES = 20

_SPARE = 1.1
"""Room for hits, as a multiple of those that the rays so far foretell."""

_CURE = "pass max_hits, or fewer rays at a time"

Progress = Callable[[int, int], object]
"""Called with the rays that are done and the number of all."""


class HitArrays(NamedTuple):
    """ray_splits: (N + 1,) int64. t: (M,) float64. prim_id: (M,) uint32. u, v: (M,) float32. truncated: (N,) bool."""

    ray_splits: NDArray[np.int64]
    t: NDArray[np.float64]
    prim_id: NDArray[np.uint32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    truncated: NDArray[np.bool_]


class Columns(NamedTuple):
    """Rays along an axis of the world. counts: (P,) int32, triangles crossed. turns: (P,) int64, those left less those
    entered. directions: (P, 3) float64."""

    counts: NDArray[np.int32]
    turns: NDArray[np.int64]
    directions: NDArray[np.float64]


class HitFinder:
    """A mesh whose hits by rays are found without rounding, each exactly once.

    mesh: around its own origin, like all rays and points. kept: (F,) bool, triangles that rays meet; None: all. pool:
    threads.
    """

    def __init__(self, mesh: Mesh, kept: NDArray[np.bool_] | None, pool: WorkerPool) -> None:
        kept = np.ones(mesh.triangle_count, np.bool_) if kept is None else kept
        self.bvh: WideBvh = wide_bvh(mesh.vertices, mesh.faces, kept, pool)
        middle, half = mesh.bounds.mean(axis=0), (mesh.bounds[1] - mesh.bounds[0]) / 2
        x, y, z = middle.tolist()
        sphere = x, y, z, float(np.linalg.norm(half))
        nodes, blocks, vertices, faces = (
            array.ctypes.data for array in (self.bvh.nodes, self.bvh.blocks, mesh.vertices, mesh.faces)
        )
        self.tree = TreeAddresses(nodes, blocks, vertices, faces, sphere)
        self.mesh = mesh  # kept, as kernels read its arrays
        self._pool, self._order = pool, RayOrder(pool)
        self._memory = [thread_memory() for _ in range(pool.threads)]
        self._found = [_memory(0) for _ in range(pool.threads)]

    def find(self, rays: Rays, most: int = MOST, progress: Progress | None = None) -> HitArrays:
        """All hits, or the `most` nearest of each ray. Raises MemoryBudgetError for more than the free memory holds."""
        count = len(rays)
        splits, truncated = np.zeros(count + 1, np.int64), np.empty(count, np.bool_)
        hits: list[NDArray] = [np.empty(0, kind) for kind in (np.float64, np.uint32, np.float32, np.float32)]
        try:
            for start in range(0, count, BATCH):
                some = slice(start, min(start + BATCH, count))
                lists = self._traced(rays, some, most)
                truncated[some] = lists.truncated
                np.cumsum(lists.counts, out=splits[some.start + 1 : some.stop + 1])
                splits[some.start + 1 : some.stop + 1] += splits[some.start]
                hits = _room(hits, int(splits[some.stop]), some.stop / count)
                self._lay_out(lists, splits[some], hits)
                if progress is not None:
                    progress(some.stop, count)
        finally:
            for worker, found in enumerate(self._found):
                if len(found.t) > _KEPT:
                    self._found[worker] = _memory(0)
        for array in hits:
            array.resize(int(splits[count]), refcheck=False)
        t, prim_id, u, v = hits
        return HitArrays(splits, t, prim_id, u, v, truncated)

    def count(self, rays: Rays, progress: Progress | None = None) -> NDArray[np.int32]:
        """(N,) int32, the number of hits of each ray."""
        return self._counted(_numbers(rays), progress)[0]

    def _counted(self, rays: Numbers, progress: Progress | None = None) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """(N,) int32, the number of hits of each ray, and (N,) int64, how many more triangles it leaves than enters."""
        count, kernel = len(rays[0]), all_hits_kernel(True)
        counts, turns = np.empty(count, np.int32), np.empty(count, np.int64)
        for start in range(0, count, BATCH):
            some = slice(start, min(start + BATCH, count))
            self._run(kernel, rays, some, _lists(counts[some], turns[some]), MOST)
            if progress is not None:
                progress(some.stop, count)
        return counts, turns

    def _run(self, kernel: Callable[..., None], rays: Numbers, some: slice, lists: Lists, most: int) -> None:
        batch = batch_of(*(array[some] for array in rays))
        self._pool.run(
            lambda worker, counter: kernel(
                counter, self.tree, batch, lists, self._memory[worker][1], self._found[worker], worker, most
            )
        )

    def hit(
        self, rays: Rays, coherent: bool | None, t: NDArray[np.float32], answers: NDArray[Any], touches: bool = False
    ) -> None:
        """Write the nearest hits of rays, or, where `t` is empty, whether they hit anything.

        coherent: as for `RayScene.intersect`. t, answers: (N,), as for `nearest_kernel`. touches: whether rays hit what
        they meet in an edge or a corner alone.
        """
        numbers = _numbers(rays)
        plan, kernel = plan_of(numbers, self.mesh, coherent, FEWEST_TRIANGLES), nearest_kernel(not len(t))
        near_by = plan.near_by if plan.is_coherent else -1.0

        def trace(batch: RayBatch, *out: NDArray[Any]) -> None:
            self._pool.run(
                lambda worker, counter: kernel(
                    counter, self.tree, batch, near_by, self._memory[worker][1], touches, *out
                )
            )

        if len(answers):
            self._order.traced(numbers, plan.in_order, trace, t, answers)

    def columns(self, points: NDArray[np.float64], everywhere: bool = False) -> Columns:
        """The crossings of a ray along an axis of the world from each point, (P, 3) float64, contiguous.

        A point outside the mesh's box crosses nothing, which says no more than its parity, unless `everywhere`.
        """
        low, high = self.mesh.bounds
        axis = int(np.argmin(high - low))
        directions = np.zeros((len(points), 3))
        directions[:, axis] = np.where(2.0 * points[:, axis] >= low[axis] + high[axis], 1.0, -1.0)
        is_asked = everywhere | ((points >= low) & (points <= high)).all(axis=1)
        counts, turns = self._counted((points, directions, np.zeros(len(points)), np.where(is_asked, np.inf, 0.0)))
        return Columns(counts, turns, directions)

    def _traced(self, rays: Rays, some: slice, most: int) -> Lists:
        """The hits of some rays, in the threads' memory."""
        count, kernel = some.stop - some.start, all_hits_kernel(False)
        lists = _lists(np.empty(count, np.int32), np.empty(count, np.int64))
        for found in self._found:
            found.used[0] = 0
        while True:
            self._run(kernel, _numbers(rays), some, lists, most)
            if lists.done.sum() == len(lists.counts):
                return lists
            full = [2 * int(found.used[0]) >= len(found.t) for found in self._found]  # or one ray has half of a memory
            self._found = [
                _grown(one) if is_full or not any(full) else one for one, is_full in zip(self._found, full, strict=True)
            ]

    def _lay_out(self, lists: Lists, starts: NDArray[np.int64], hits: list[NDArray]) -> None:
        self._pool.run(lambda worker, counter: lay_out(counter, worker, lists, self._found[worker], starts, *hits))


def _numbers(rays: Rays) -> Numbers:
    return rays.origins, rays.directions, rays.tnear, rays.tfar


def _lists(counts: NDArray[np.int32], places: NDArray[np.int64]) -> Lists:
    return Lists(np.zeros(-(-len(counts) // CHUNK), np.int64), counts, places, np.empty(len(counts), np.bool_))


def _memory(size: int) -> Hits:
    arrays = np.empty(size), np.empty(size, np.uint32), np.empty(size, np.float32), np.empty(size, np.float32)
    return Hits(*arrays, np.zeros(1, np.int64))


def _grown(found: Hits) -> Hits:
    """Memory for twice as many hits, with those found so far."""
    size, used = max(2 * len(found.t), _START), int(found.used[0])
    check_needed_bytes(size * _HIT_BYTES, None, f"{size:,} hits of a batch of rays", _CURE)
    grown = _memory(size)
    arrays = (found.t, grown.t), (found.prim_id, grown.prim_id), (found.u, grown.u), (found.v, grown.v)
    for before, after in arrays:
        after[:used] = before[:used]  # type: ignore[index]
    grown.used[0] = used
    return grown


def _room(hits: list[NDArray], count: int, done: float) -> list[NDArray]:
    """Arrays that hold `count` hits, of the share `done` of all rays.

    The first ones are new, with room for as many as that foretells: numpy asks for large pages then. Later they are
    resized, without a copy where the system can move pages. Memory is used where it is written alone.
    """
    if count <= len(hits[0]):
        return hits
    foreseen = max(int(_SPARE * count / done), count)
    try:
        check_needed_bytes((foreseen - len(hits[0])) * _HIT_BYTES, None, f"{foreseen:,} hits of rays", _CURE)
    except MemoryBudgetError:
        foreseen = count
        check_needed_bytes((foreseen - len(hits[0])) * _HIT_BYTES, None, f"{foreseen:,} hits of rays", _CURE)
    if not len(hits[0]):
        return [np.empty(foreseen, array.dtype) for array in hits]
    for array in hits:
        array.resize(foreseen, refcheck=False)
    return hits
