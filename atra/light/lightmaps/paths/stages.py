"""A bake that follows paths one after the other, through all that the materials of a scene do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light.emitters.tables import emitters_of
from atra.light.laps import Laps
from atra.light.lightmaps.batches import Job, Work
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.gather.probes import ProbeSums
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.paths.texels_kernels import Charts, light_probes, light_texels
from atra.light.pictures.path_kernels import FREE_ROWS
from atra.light.pictures.paths.following_kernels import limits_of
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query

AT_ONCE = 1 << 12
"""Paths that a thread takes at a time."""


class Paths:
    """The tables of a scene and of its texels."""

    def __init__(self, scene: Scene, texels: Texels, options: BakeOptions) -> None:
        mesh = scene.mesh.local
        self._surfaces = surfaces_of(scene, scene.sky.power, None)
        self._emitters = emitters_of(scene)
        self._charts = Charts(
            mesh.vertices, mesh.faces, texels.atlas.uv, texels.prim_id, texels.number, texels.atlas.width,
            np.float32(options.open_length), np.uint32(options.seed),
        )  # fmt: skip
        self._limits = limits_of(options.bounces, options.roulette_from, 1)

    def of_thread(self, query: Query, work: Work) -> PathsOfThread:
        """What a thread bakes with."""
        rest = self._surfaces, self._emitters, self._limits, query.scene, query.packet
        return PathsOfThread(self._charts, rest, work)


class PathsOfThread:
    """As `Stages`, for paths."""

    def __init__(self, charts: Charts, rest: tuple[Any, ...], work: Work) -> None:
        self._given = charts, *rest, np.zeros((FREE_ROWS, 1), np.float32)
        self._lap, self._work = Laps(work.stage_s), work

    def add(self, job: Job, first: int, count: int) -> int:
        """As `add_batch`."""
        told = np.array([0, -1])
        light_texels(job.order, first, count, job.expansion, job.samples, *self._given, job.sums, told)
        return self._counted(told)

    def add_probes(self, sums: ProbeSums, first: int, count: int) -> None:
        """As `ProbeSums.add`."""
        told = np.array([0, -1])
        light_probes(sums.points, first, count, sums.samples, *self._given, sums.light, sums.backs, told)
        sums.check(self._counted(told))

    def _counted(self, told: NDArray[np.int64]) -> int:
        rays, bad = told.tolist()
        self._work.traced(rays, rays)
        self._lap("paths")
        return int(bad)
