"""Peer `embreex`: `EmbreeScene.run`, the Python binding most programs use."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree.library import wheel_problem
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.methods.peers.peer import Answer, BlockScene, peer_method


class EmbreexScene(BlockScene):
    """`EmbreeScene.run(origins, directions, output=True)`: a loop over `rtcIntersect1`, robust as is its default.

    Timed: that call, which also stores u, v and the normal of each hit and allocates its arrays; it is the
    one way to get depth and triangle of a ray from one traversal. What it returns needs no conversion. The BVH is
    built by every core.
    """

    package = "embreex"
    interface = "EmbreeScene.run(output=True), single rays"
    setting = "robust, its default"

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        super().__init__(threads)
        self._scene: Any = import_module("embreex.rtcore_scene").EmbreeScene()
        construction = import_module("embreex.mesh_construction")
        construction.TriangleMesh(self._scene, mesh.vertices, mesh.faces.astype(np.int32))
        nowhere = np.zeros((1, 3), np.float32)
        self._scene.run(nowhere, nowhere + 1)  # embreex builds the BVH in the first query

    def cast_block(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Answer:
        hits = self._scene.run(origins, directions, dists=np.inf, output=True)
        return hits["tfar"], hits["primID"].view(np.uint32)  # -1 is a miss, that is MISS


def _check() -> str | None:
    import_module("embreex.rtcore_scene")
    import_module("embreex.mesh_construction")
    return None


EMBREEX = peer_method("embreex", "embreex", _check, EmbreexScene, wheel_problem)
