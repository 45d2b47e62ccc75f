"""Peer `embreex`: `EmbreeScene.run`, the Python binding most programs use."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from atra.embree.library import wheel_problem
from experiments.methods.peers.peer import Answer, PreparedBlocks, RayArrays, peer_method


class PreparedEmbreex(PreparedBlocks):
    """`EmbreeScene.run(origins, directions, output=True)`: a loop over `rtcIntersect1`, robust as is its default.

    Timed: that call, which also stores u, v and the normal of each hit and allocates its arrays; it is the
    one way to get depth and triangle of a ray from one traversal. What it returns needs no conversion. The BVH is
    built by every core.
    """

    package = "embreex"
    interface = "EmbreeScene.run(output=True), single rays"
    setting = "robust, its default"

    def _build_scene(self) -> Any:
        scene = import_module("embreex.rtcore_scene").EmbreeScene()
        import_module("embreex.mesh_construction").TriangleMesh(
            scene, self.mesh.vertices, self.mesh.faces.astype(np.int32)
        )
        nowhere = np.zeros((1, 3), np.float32)
        scene.run(nowhere, nowhere + 1)  # embreex builds the BVH in the first query
        return scene

    def _cast(self, scene: Any, rays: RayArrays) -> Answer:
        def cast(block: RayArrays) -> Answer:
            hits = scene.run(block.origins, block.directions, dists=np.inf, output=True)
            return hits["tfar"], hits["primID"].view(np.uint32)  # -1 is a miss, that is MISS

        return self._in_blocks(cast, rays)


def _check() -> str | None:
    import_module("embreex.rtcore_scene")
    import_module("embreex.mesh_construction")
    return None


EMBREEX = peer_method("embreex", "embreex", _check, PreparedEmbreex, wheel_problem)
