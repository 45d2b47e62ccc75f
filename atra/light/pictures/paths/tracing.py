"""What traces the rays of a wave of paths: packets of Embree's, or a scene that takes them in batches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from atra.embree.packets_kernels import START
from atra.geometry.mesh import Mesh
from atra.light.emitters.emitters_kernels import Emitters
from atra.light.pictures.path_kernels import BLOCK, FREE_ROWS
from atra.light.pictures.paths.batches_kernels import (
    AIM_DIRECTION,
    AIM_LENGTH,
    AIM_ORIGIN,
    AIM_ROWS,
    add_aimed,
    aim_paths,
)
from atra.light.pictures.paths.waves_kernels import DIRECTION, NEAR, ORIGIN, Paths, connect_kernel, trace_kernel
from atra.light.surface_kernels import Surfaces
from atra.rays.kernel_scene import Query
from atra.rays.rays import RayHits, Rays


class BatchScene(Protocol):
    """A mesh that takes rays in batches, which it prepares first."""

    @property
    def build_time_s(self) -> float: ...

    def prepare(self, rays: Rays) -> Any: ...

    def intersect(self, prepared: Any) -> RayHits: ...

    def occluded(self, prepared: Any) -> NDArray[np.bool_]: ...

    def build(self) -> Any: ...

    def update(self, mesh: Mesh) -> None: ...

    def close(self) -> None: ...


MakeScene = Callable[[Mesh], BatchScene]
"""Function from a mesh to what traces batches of rays through it."""


class Packets:
    """A thread's packets of a `KernelScene`."""

    def __init__(self, query: Query, width: int) -> None:
        self._query, self._width = query, width
        self._lights, self._free = np.empty((3, width), np.float32), np.empty((FREE_ROWS, width), np.float32)

    def trace(self, paths: Paths) -> int:
        """Find what the rays of all paths hit; returns their number."""
        return trace_kernel(self._width)(paths, self._query.scene, self._query.packet)

    def connect(self, paths: Paths, surfaces: Surfaces, emitters: Emitters, sample: int, sums: NDArray[Any]) -> int:
        """Aim a ray from every path at an emitter, and add what arrives; returns their number, -1 for light that is not
        finite."""
        scene, packet = self._query.scene, self._query.packet
        kernel = connect_kernel(self._width)
        return kernel(paths, surfaces, emitters, scene, packet, self._lights, self._free, sample, sums)


class Batches:
    """All rays of a wave as one batch of a scene, in place of a `KernelScene` and of its packets.

    Surfaces with holes are refused by the renderer: shadows pass them hit by hit. Waves are traced one after the other;
    the scene may have several threads.
    """

    threads = packet_width = 1

    def __init__(self, scene: BatchScene) -> None:
        self.scene = scene

    @property
    def build_time_s(self) -> float:
        """Seconds that the scene took to build."""
        return self.scene.build_time_s

    def build(self) -> None:
        self.scene.build()

    def update(self, mesh: Mesh) -> None:
        self.scene.update(mesh)

    def close(self) -> None:
        self.scene.close()

    def run(self, work: Callable[[Query], None]) -> None:
        """Call `work` once."""
        work(Query(0, 0, 0, None, None))

    def trace(self, paths: Paths) -> int:
        """As `Packets.trace`."""
        chosen = _going(paths)
        floats = paths.floats[:, chosen]
        rays = Rays(floats[ORIGIN : ORIGIN + 3].T, floats[DIRECTION : DIRECTION + 3].T, floats[NEAR])
        hits = self.scene.intersect(self.scene.prepare(rays))
        paths.prim_id[chosen], paths.floats[NEAR, chosen] = hits.prim_id, hits.t
        return len(chosen)

    def connect(self, paths: Paths, surfaces: Surfaces, emitters: Emitters, sample: int, sums: NDArray[Any]) -> int:
        """As `Packets.connect`."""
        chosen = _going(paths)
        aimed = np.empty((AIM_ROWS, len(chosen)), np.float32)
        aim_paths(paths, chosen, surfaces, emitters, sample, aimed)
        there = aimed[AIM_LENGTH] > 0.0
        chosen, aimed = chosen[there], aimed[:, there]
        origins, directions = (aimed[first : first + 3].T for first in (AIM_ORIGIN, AIM_DIRECTION))
        near = np.full(len(chosen), START)
        is_free = ~self.scene.occluded(self.scene.prepare(Rays(origins, directions, near, aimed[AIM_LENGTH])))
        is_finite = add_aimed(paths, chosen[is_free], np.ascontiguousarray(aimed[:, is_free]), sums)
        return len(chosen) if is_finite else -1


def _going(paths: Paths) -> NDArray[np.int64]:
    """Numbers of the paths that go on."""
    return np.flatnonzero(np.arange(len(paths.counts) * BLOCK) % BLOCK < np.repeat(paths.counts, BLOCK))
