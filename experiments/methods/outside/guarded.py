"""A foreign method, held to what it promises: made where it is measured, timed apart from all checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.method import Method, Prepared
from experiments.methods.outside.guards import ClockGuard, ThreadGuard, check_images, check_mesh, delays_s, mesh_digest

_MESH_CHECKS = 3
"""Frames after which the mesh is looked at; after these, only when the tracer is closed."""


class PreparedGuarded(Prepared):
    """What a foreign method has prepared.

    own: the foreign object; that of a program has an attribute `process`. build_time_s: all that it took, by the
    harness's clock; of a program by its own, as starting it and writing files is no part of a build. frame_time_s:
    seconds of the last frame, without the checks of what it drew; by its own clock where it has an attribute `time_s`
    that may be true.
    """

    def __init__(self, method: Guarded, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self._mesh, self._camera, self._frames = mesh, camera, 0
        self._clock = ClockGuard(camera.width * camera.height)
        self._guard = ThreadGuard(pool.threads, self._processes)
        self._digest, self.frame_time_s = mesh_digest(mesh), 0.0
        start = perf_counter()
        method.own.check(mesh, camera)
        self.own = method.own.prepare(mesh, camera, pool)
        waited_s = perf_counter() - start
        self.build_time_s = self.own.build_time_s if hasattr(self.own, "process") else waited_s
        try:
            check_mesh(mesh, self._digest)
        except BaseException:
            self.own.close()
            raise

    @property
    def row_stride(self) -> int:
        """As the method says."""
        return self.own.row_stride

    @property
    def triangle_count(self) -> int:
        """As the method says, or those of the mesh."""
        return self.own.triangle_count or self._mesh.triangle_count

    @property
    def counters(self) -> Mapping[str, float]:
        """As the method says."""
        return self.own.counters

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """Have it draw, and look at the clock, the threads, the mesh and the image."""
        depth.fill(np.nan)  # what it does not write is found
        processes = self._processes()
        self._guard.begin()
        before_s = delays_s(processes)
        start = perf_counter()
        self.own.draw(offset, depth, prim_id)
        waited_s = perf_counter() - start
        delayed_s = delays_s(processes) - before_s
        self._guard.end()
        self.frame_time_s = self._clock.frame_time_s(waited_s, getattr(self.own, "time_s", None), delayed_s)
        self._frames += 1
        if self._frames <= _MESH_CHECKS:
            check_mesh(self._mesh, self._digest)
        check_images(depth, prim_id, self._mesh.triangle_count)

    def _processes(self) -> list[psutil.Process]:
        first = getattr(self.own, "process", None) or psutil.Process()
        return [first, *first.children(recursive=True)]

    def close(self) -> None:
        """Close it, and look at the mesh a last time."""
        self.own.close()
        check_mesh(self._mesh, self._digest)


@dataclass(frozen=True)
class Guarded(Method):
    """A foreign method as one of the harness. Nothing of it runs before `prepare`, so planning a sweep meets none of
    its faults. own: the foreign value."""

    own: Any

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedGuarded:
        """Ask the method whether it takes these, and have it prepare."""
        return PreparedGuarded(self, mesh, camera, pool)
