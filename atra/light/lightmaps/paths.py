"""A bake's options, and the tables that its paths need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from atra.choices import check_choice
from atra.light.checks import check_clamp, check_rays, check_whole, checked_number
from atra.light.emitters.tables import emitters_of
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.paths_kernels import Charts
from atra.light.pictures.following_kernels import limits_of
from atra.light.pictures.path_kernels import FREE_ROWS
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query

AT_ONCE = 1 << 12
"""Paths that a thread takes at a time."""


@dataclass(frozen=True)
class BakeOptions:
    """Options of `Baker`, which says what each is for. Raises InputError, with the value. Source: the values of Unity's
    lightmapper, where it has any."""

    packet_width: ClassVar[int] = 1  # rays are incoherent

    threads: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    bounces: int = 4
    roulette_from: int | None = 2
    open_length: float = 1.0
    lights: str = "aimed"
    seed: int = 0
    clamp: float | None = None

    def __post_init__(self) -> None:
        check_rays(self)
        check_choice("lights", self.lights, ("aimed", "grid"))
        check_whole("bounces", self.bounces, 0, 1 << 10)
        if self.roulette_from is not None:
            check_whole("roulette_from", self.roulette_from, 0, 1 << 20)
        object.__setattr__(self, "open_length", checked_number("open_length", self.open_length, 0.0, 1e30, above=True))
        check_whole("seed", self.seed, 0, (1 << 32) - 1)
        check_clamp(self)


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

    def tables(self, query: Query) -> tuple[Any, ...]:
        """What kernels of paths are handed, from `charts` to `free`."""
        free = np.zeros((FREE_ROWS, 1), np.float32)
        return self.charts, self.surfaces, self.emitters, self.limits, query.scene, query.packet, free
