"""A bake's paths, followed one after the other through all that the materials of a scene do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.emitters.tables import emitters_of
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.paths_kernels import Charts, light_probes, light_texels
from atra.light.lightmaps.probes import ProbeSums
from atra.light.pictures.following_kernels import limits_of
from atra.light.pictures.path_kernels import FREE_ROWS
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query

AT_ONCE = 1 << 12
"""Paths that a thread takes at a time."""


class Paths:
    """The tables of a scene, of its emitters and of its texels. Raises InputError for light that float32 cannot
    hold."""

    def __init__(self, scene: Scene, texels: Texels, options: BakeOptions) -> None:
        mesh = scene.mesh.local
        self.surfaces = surfaces_of(scene, scene.sky.power)
        self.emitters = emitters_of(scene, options.lights)
        self.charts = Charts(
            mesh.vertices, mesh.faces, texels.atlas.uv, texels.prim_id, texels.number, texels.atlas.width,
            np.float32(options.open_length), np.uint32(options.seed),
        )  # fmt: skip
        self.limits = limits_of(options.bounces, options.roulette_from, options.clamp, 1)

    def light(
        self, query: Query, order: NDArray[np.int32], part: tuple[int, int], count: int, samples: NDArray[np.int32],
        sums: NDArray[np.float64],
    ) -> tuple[int, int]:  # fmt: skip
        """Add `count` samples to a part of the texels, (first, number) places of an order, and count them.

        samples: (N,) int32 and sums: (N, SUMS), both written to. Returns how many rays were traced, and the number of a
        texel whose light is not finite, -1 for none.
        """
        told = np.array([0, -1])
        light_texels(order, *part, count, samples, *self._tables(query), sums, told)
        return int(told[0]), int(told[1])

    def light_probes(self, query: Query, sums: ProbeSums, first: int, count: int) -> int:
        """Add all samples of `count` probes from number `first` on; returns how many rays were traced. Raises AtraError
        for light that is not finite."""
        told = np.array([0, -1])
        light_probes(sums.points, first, count, sums.samples, *self._tables(query), sums.light, sums.backs, told)
        sums.check(int(told[1]))
        return int(told[0])

    def _tables(self, query: Query) -> tuple[object, ...]:
        free = np.zeros((FREE_ROWS, 1), np.float32)
        return self.charts, self.surfaces, self.emitters, self.limits, query.scene, query.packet, free
