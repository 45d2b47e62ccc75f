"""Peer `open3d`: `RaycastingScene.cast_rays`."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.methods.peers.peer import INSTALL, Answer, Answering, Asked, PeerScene, peer_method


class Open3DScene(PeerScene):
    """`RaycastingScene.cast_rays(rays, nthreads=threads)`: single rays, shared out among TBB's threads.

    Timed: that call, which also stores geometry, u, v and the normal of each hit, and numpy views of depth
    and triangle. What it returns needs no conversion: its miss has depth inf and the id 0xFFFFFFFF.
    """

    package = "open3d"
    interface = "RaycastingScene.cast_rays, single rays"
    setting = "robust, no other"

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        self._open3d, self._threads = import_module("open3d"), {"nthreads": threads}
        self._scene = self._open3d.t.geometry.RaycastingScene(**self._threads)
        self._scene.add_triangles(self._tensor(mesh.vertices.copy()), self._tensor(mesh.faces.copy()))
        self._scene.cast_rays(self._tensor(np.ones((1, 6), np.float32)), **self._threads)  # the first query builds

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Any:
        """A tensor of six numbers a ray."""
        return self._tensor(np.concatenate([np.broadcast_to(origins, directions.shape), directions], axis=1))

    def cast(self, rays: Any) -> Answer:
        hits = self._scene.cast_rays(rays, **self._threads)
        return hits["t_hit"].numpy(), hits["primitive_ids"].numpy()

    def answers(self) -> Mapping[str, Answering]:
        scene, threads, rays = self._scene, self._threads, self.make_rays

        def all_hits(*given: NDArray[np.float32]) -> Asked:
            hits = scene.list_intersections(rays(*given), **threads)
            return hits["ray_ids"].numpy(), hits["primitive_ids"].numpy()

        return {
            "closest": lambda *given: scene.cast_rays(rays(*given), **threads)["primitive_ids"].numpy(),
            "any": lambda *given: scene.test_occlusions(rays(*given), **threads).numpy(),
            "count": lambda *given: scene.count_intersections(rays(*given), **threads).numpy(),
            "all": all_hits,
            "contains": lambda points: scene.compute_occupancy(self._tensor(points), **threads).numpy() > 0.5,
        }

    def _tensor(self, array: NDArray[Any]) -> Any:
        """A tensor in the memory of `array`, which must be writable."""
        return self._open3d.core.Tensor.from_numpy(array)


def _check() -> str | None:
    open3d = import_module("open3d")
    return None if hasattr(open3d.t.geometry, "RaycastingScene") else f"open3d has no RaycastingScene; {INSTALL}"


OPEN3D = peer_method("open3d", "Open3D", _check, Open3DScene)
