"""Batches: rays of many texels that pass all stages together; each thread has its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.light.laps import Laps
from atra.light.lightmaps.bounces_kernels import compact, end_weak, scatter, shade, trace_kernel
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.gather.lights_kernels import aim, aim_at_sun, plane_of
from atra.light.lightmaps.gather.tables_kernels import KIND, PATH_ROWS, RESULTS, SUMS, SUN, Batch, Tables
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.paint_kernels import Paint
from atra.light.lightmaps.samples_kernels import gather, generate
from atra.light.lightmaps.shadows_kernels import shine_kernel
from atra.light.pictures.path_kernels import ROW_PADDING
from atra.rays.kernel_scene import KernelScene, Query

_RAY_BYTES = 4 * (PATH_ROWS + 6 + RESULTS) + 1
"""Memory per ray in flight."""

_TEXEL_BYTES = 2 * 8 * SUMS + 144
"""Peak memory of a texel: its sums and their means, and the arrays of `Texels` and `Lightmap`."""

_NEVER = 1 << 30


def needed_bytes(texels: int, rays: int) -> int:
    """Peak memory of a map of so many texels, all of them lit, with so many rays in flight."""
    return texels * _TEXEL_BYTES + rays * _RAY_BYTES


@dataclass
class Work:
    """What a thread has done: seconds by stage, rays traced, and lanes of their batches, idle ones included."""

    stage_s: dict[str, float]
    rays: int = 0
    lanes: int = 0

    def traced(self, rays: int, lanes: int) -> None:
        self.rays += rays
        self.lanes += lanes


def stage_seconds(works: list[Work], ordered_s: float, whole_s: float) -> dict[str, float]:
    """Seconds by stage, the mean of all threads; "other" is what is left of the whole."""
    stages = {"order": ordered_s}
    for one in works:
        for stage, seconds in one.stage_s.items():
            stages[stage] = stages.get(stage, 0.0) + seconds / len(works)
    return stages | {"other": whole_s - sum(stages.values())}


def in_batches(
    scene: KernelScene,
    starts: int,
    per_batch: int,
    stages_of: Callable[[Query, Work], Any],
    add: Callable[[int, int, Any], None],
    stop: Callable[[], bool] | None,
) -> tuple[bool, list[Work]]:
    """Call `add(first, count, stages)` in all threads until all `starts` entries had their turn, `per_batch` at a time.

    stages_of: makes what a thread bakes with. Returns whether it finished, and each thread's work.
    """
    left = deque(range(0, starts, per_batch))  # `popleft` is thread-safe
    works = [Work({}) for _ in range(scene.threads)]

    def work(query: Query) -> None:
        stages = stages_of(query, works[query.worker])
        while stop is None or not stop():
            try:
                first = left.popleft()
            except IndexError:
                return
            add(first, min(per_batch, starts - first), stages)

    scene.run(work)
    return not left, works


class Stages:
    """The stages that all batches of a thread pass.

    scene: its tables, and `BakeScene.paint`. kind: packet width, and RTCScenes of what blocks light and of panes (0 =
    none).
    """

    def __init__(
        self, scene: tuple[Tables, Paint | None], options: BakeOptions, kind: tuple[int, tuple[int, int]],
        query: Query, work: Work, batch: Batch,
    ) -> None:  # fmt: skip
        self._tables, self._paint = scene
        self._batch = batch
        self._options, self._query, self._work = options, query, work
        width, self._shadows = kind
        has_panes = self._shadows[1] != 0
        self._trace, self._shine = trace_kernel(width, has_panes), shine_kernel(width, has_panes)
        self.lap = Laps(work.stage_s)

    def add(self, job: Job, first: int, count: int) -> int:
        """As `add_batch`."""
        return add_batch(job, first, count, self._tables, self._batch, self)

    def add_probes(self, sums: Any, first: int, count: int) -> None:
        """As `ProbeSums.add` of sums."""
        sums.add(first, count, self._tables, self._batch, self)

    def light(self, batch: Batch, count: int, which: int, vertex: int) -> None:
        """Trace rays to light `which`, or to a random one if that is -1, and add what they carry."""
        tables, query = self._tables, self._query
        only = 0 if len(tables.lights) == 1 else which
        if only >= 0 and tables.lights[only, KIND] == SUN:
            aim_at_sun(batch, count, tuple(tables.lights[only]), only, vertex)
        else:
            aim(batch, count, tables, which, vertex)
        self.lap("aim")
        plane = plane_of(vertex, int(tables.lights[max(which, 0), KIND]))
        self._work.traced(self._shine(batch, count, plane, tables, self._paint, self._shadows, query.packet), count)
        self.lap("shadow")

    def follow(self, batch: Batch, count: int) -> None:
        """Follow paths whose first directions are set to their ends."""
        tables, paint, options, query = self._tables, self._paint, self._options, self._query
        roulette_from = _NEVER if options.roulette_from is None else options.roulette_from
        for vertex in range(options.bounces + 1):
            if vertex:
                if len(tables.lights):
                    self.light(batch, count, -1, vertex)
                if vertex >= roulette_from:
                    going = end_weak(batch, count, vertex)
                    self.lap("scatter")
                    if going == 0:
                        break
                    count = self._compacted(batch, count)
                scatter(batch, count, vertex)
                self.lap("scatter")
            self._work.traced(self._trace(batch, count, tables, paint, vertex, query.scene, query.packet), count)
            self.lap("trace")
            going = shade(batch, count, tables, paint, vertex, vertex == options.bounces)
            self.lap("shade")
            if going == 0:
                break
            count = self._compacted(batch, count)

    def _compacted(self, batch: Batch, count: int) -> int:
        """Move the paths that continue to the front, if lanes are to be full; returns how many lanes there are."""
        if self._options.compaction != "bounces":
            return count
        going: int = compact(batch, count)
        self.lap("compact")
        return going


class Job(NamedTuple):
    """What all batches of a pass share. order: as for `generate`. expansion: samples per texel. samples, sums: written
    to."""

    texels: Texels
    order: NDArray[np.int32]
    expansion: int
    samples: NDArray[np.int32]
    sums: NDArray[np.float64]


def new_batch(rays: int) -> Batch:
    """A batch with memory for `rays` rays."""
    return Batch(
        np.zeros((PATH_ROWS, rays + ROW_PADDING), np.float32),
        np.empty(rays, np.uint32),
        np.empty(rays, np.float32),
        np.empty(rays, np.uint32),
        np.arange(rays, dtype=np.int32),
        np.zeros(rays, np.int8),
        np.zeros(rays, np.uint32),
        np.zeros(rays, np.uint32),
        np.empty((rays, RESULTS), np.float32),
    )


def add_batch(job: Job, first: int, texel_count: int, tables: Tables, batch: Batch, stages: Stages) -> int:
    """Add samples to `texel_count` texels from place `first` of the order on.

    Returns the number of a texel whose light is not finite, or -1.
    """
    texels, expansion = job.texels, job.expansion
    lit = texels.prim_id, texels.number
    generate(batch, job.order, first, texel_count, expansion, job.samples, lit, tables)
    count = texel_count * expansion
    stages.lap("generate")
    for which in range(len(tables.lights)):
        stages.light(batch, count, which, 0)
    scatter(batch, count, 0)
    stages.lap("scatter")
    stages.follow(batch, count)
    bad = gather(batch, job.order, first, texel_count, expansion, job.samples, job.sums)
    stages.lap("gather")
    return int(bad)
