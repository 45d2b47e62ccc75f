"""Rays of a path-traced picture, as batches."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.light import PathRenderer
from atra.rays.rays import RayHits, Rays
from atra.rays.scene import RayScene
from scenes.lit.lighting import lit

PATH_KINDS = ("bounce", "shadow")
"""Rays of paths after the first: those that surfaces scatter, and those aimed at lights."""


def path_rays(kind: str, name: str, mesh: Mesh, camera: Camera, threads: int | None) -> Rays:
    """All rays of one of `PATH_KINDS` in one sample of the scene called `name` in its light; the same for everyone.

    Those of the first bounce come first, in the order of pixels, then those of the second.
    """
    recorder = _Recorder(mesh, threads)
    options: Any = {"order": "waves", "wave_rays": 1 << 24, "threads": threads}
    with PathRenderer(lit(name, mesh, camera), camera, rays=lambda _: recorder, **options) as renderer:
        renderer.add(1)
    batches = recorder.batches[kind]
    fields = ("origins", "directions", "tnear", "tfar")
    return Rays(*(np.concatenate([getattr(one, field) for one in batches]) for field in fields))


class _Recorder:
    """A `RayScene` that takes batches, and keeps their rays by kind."""

    def __init__(self, mesh: Mesh, threads: int | None) -> None:
        self._scene = RayScene(mesh, threads=threads)
        self.batches: dict[str, list[Rays]] = {kind: [] for kind in PATH_KINDS}
        self.build, self.update, self.close = self._scene.build, self._scene.update, self._scene.close

    @property
    def build_time_s(self) -> float:
        return self._scene.build_time_s

    def prepare(self, rays: Rays) -> Rays:
        return rays

    def intersect(self, rays: Rays) -> RayHits:
        self.batches["bounce"].append(rays)
        return self._scene.intersect(rays)

    def occluded(self, rays: Rays) -> NDArray[np.bool_]:
        self.batches["shadow"].append(rays)
        return self._scene.occluded(rays)
