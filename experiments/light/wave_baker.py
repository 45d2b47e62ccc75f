"""A small baker in waves: paths of many texels pass every stage together, with lanes packed or not. It is measured for
what the article on a progressive lightmapper claims of compaction and expansion."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light import Atlas, Lightmap, Scene, Texels, constant_sky
from atra.light.batches import Laps, in_batches
from atra.light.emitters.emitters_kernels import has_emitters
from atra.light.emitters.tables import emitters_of
from atra.light.lightmaps.paths import BakeOptions, Paths
from atra.light.lightmaps.paths_kernels import SUMS
from atra.light.pictures.path_kernels import FREE_ROWS
from atra.rays.kernel_scene import Query, scene_for_kernels
from experiments.light import waves_kernels as waves


class WaveBaker(AbstractContextManager["WaveBaker"]):
    """Samples of a lightmap as `atra.light.Baker` makes them to the bit, in waves.

    environment: whether a panorama is found by both kinds of rays, "mis", or by scattered ones alone, "bsdf".
    compaction: lanes packed together: all of the map, "none"; lit texels, "texels"; or also paths that go on after a
    bounce, "bounces". batch_rays: rays in flight, of all threads. expansion: samples of a texel side by side. options:
    of `Baker`.
    stage_s: seconds by stage, averaged over threads. rays, lanes: rays traced, and lanes of their packets, idle ones
    included. buffer_bytes: memory of the rays in flight. Other attributes are those of `Baker`.
    """

    def __init__(
        self, scene: Scene, atlas: Atlas, *, environment: str = "mis", compaction: str = "bounces",
        batch_rays: int = 1 << 19, expansion: int = 16, **options: Any,
    ) -> None:  # fmt: skip
        self.scene, self.options = scene, BakeOptions(**options)
        self.compaction, self.expansion = compaction, expansion
        self.texels, self.rays_scene = Texels.of(scene.mesh, atlas), scene_for_kernels(scene.mesh, self.options)
        self._paths = Paths(scene, self.texels, self.options)
        aimed_at = replace(scene, sky=constant_sky(0.0)) if environment == "bsdf" else scene
        self._emitters = emitters_of(aimed_at, self.options.lights)
        self.visible: NDArray[np.bool_] | None = None
        self.samples, self._sums = np.zeros(len(self.texels), np.int32), np.zeros((len(self.texels), SUMS))
        threads = self.rays_scene.threads
        self.paths_at_once = max(batch_rays // threads, expansion)
        self._waves = [waves.new_wave(self.paths_at_once) for _ in range(threads)]
        self.buffer_bytes = sum(array.nbytes for wave in self._waves for array in wave)
        self.stage_s: dict[str, float] = {}
        self.rays = self.lanes = 0
        self.rays_scene.build()

    def __exit__(self, *error: object) -> None:
        self.rays_scene.close()

    @property
    def maps(self) -> Lightmap:
        """The means of all samples so far; a copy."""
        return Lightmap.of(self.texels, self.samples.copy(), self._sums)

    def add(self, samples: int, wanted: NDArray[np.bool_] | None = None) -> None:
        """Add so many samples to the wanted texels, (N,); None: to all."""
        start = perf_counter()
        order = self._order(np.ones(len(self.texels), np.bool_) if wanted is None else wanted)
        self._took("order", perf_counter() - start)
        while samples > 0 and len(order):
            count = min(samples, self.expansion)
            self._pass(order, count)
            samples -= count

    def _order(self, wanted: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Numbers of wanted texels, neighbours together; or those of the whole map in rows, -1 elsewhere."""
        texels = self.texels
        if self.compaction != "none":
            return texels.along_curve[wanted[texels.along_curve]]
        order = np.full(texels.atlas.width * texels.atlas.height, -1, np.int32)
        order[texels.number[wanted]] = np.flatnonzero(wanted)
        return order

    def _took(self, stage: str, seconds: float) -> None:
        self.stage_s[stage] = self.stage_s.get(stage, 0.0) + seconds

    def _pass(self, order: NDArray[np.int32], expansion: int) -> None:
        start, threads = perf_counter(), self.rays_scene.threads
        stages: list[dict[str, float]] = [{} for _ in range(threads)]
        lanes = [0] * threads

        def add(query: Query, first: int, texels: int) -> int:
            wave, lap = self._waves[query.worker], Laps(stages[query.worker])
            charts, surfaces = self._paths.charts, self._paths.surfaces
            waves.generate(wave, order, first, texels, expansion, self.samples, charts, surfaces)
            lap("generate")
            traced, filled = self._follow(query, wave, texels * expansion, lap)
            if not waves.gather(wave, order, first, texels, expansion, self.samples, self._sums):
                raise ArithmeticError("light is not finite; make lights or materials darker")
            lap("gather")
            lanes[query.worker] += filled
            return traced

        self.rays += in_batches(self.rays_scene, len(order), max(1, self.paths_at_once // expansion), add)[1]
        self.lanes += sum(lanes)
        other = perf_counter() - start
        for name, seconds in (taken for one in stages for taken in one.items()):
            self._took(name, seconds / threads)
            other -= seconds / threads
        self._took("other", other)

    def _follow(self, query: Query, wave: waves.Wave, count: int, lap: Laps) -> tuple[int, int]:
        """Follow the paths of a wave to their ends; returns rays traced, and lanes of their packets."""
        surfaces, emitters, limits = self._paths.surfaces, self._emitters, self._paths.limits
        free, is_packed = np.zeros((FREE_ROWS, 1), np.float32), self.compaction == "bounces"
        rays = lanes = 0
        while True:
            if has_emitters(emitters):
                waves.aim(wave, count, surfaces, emitters)
                lap("aim")
                rays, lanes = rays + waves.shine(wave, count, surfaces, query.scene, query.packet, free), lanes + count
                lap("shadow")
            going = waves.scatter(wave, count, surfaces, limits.roulette)
            lap("scatter")
            if going:
                count = self._packed(wave, count, lap) if is_packed else count
                rays, lanes = rays + waves.trace(wave, count, query.scene, query.packet), lanes + count
                lap("trace")
                going = waves.shade(wave, count, surfaces, emitters, limits.max_depth, self._paths.charts.open_length)
                lap("shade")
            if not going:
                return rays, lanes
            count = self._packed(wave, count, lap) if is_packed else count

    def _packed(self, wave: waves.Wave, count: int, lap: Laps) -> int:
        going: int = waves.compact(wave, count)
        lap("compact")
        return going
