"""Peer `trimesh`: `mesh.ray.intersects_first`, which runs on embreex."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.compiled.store import keep_on_disk
from atra.embree.library import wheel_problem
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.methods.peers.peer import Answer, Answering, Asked, BlockScene, Rays, peer_method


class TrimeshScene(BlockScene):
    """`mesh.ray.intersects_first(origins, directions)`: copies, scales and normalises the rays and runs embreex.

    Timed: that call, which returns triangles without depth, and one compiled pass that computes the depth
    from planes prepared beforehand; trimesh's own function that returns locations takes longer. The BVH is built by
    every core. Normalising goes through numpy's BLAS, which uses every core whatever `threads` says, unless
    OPENBLAS_NUM_THREADS was set before numpy was imported.
    """

    package = "trimesh"
    interface = "ray.intersects_first on embreex, single rays"
    setting = "robust, its default"

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        import trimesh  # slow to import

        super().__init__(threads)
        self._mesh = mesh
        self._ray = trimesh.Trimesh(mesh.vertices, mesh.faces.astype(np.int64), process=False, validate=False).ray
        nowhere = np.zeros((1, 3), np.float32)
        self._ray.intersects_first(nowhere, nowhere + 1)  # builds the BVH, which waits for the first query

    def plan(self) -> None:
        """The planes of the triangles: normals of any length, and distances from the world's origin times that."""
        corners = self._mesh.triangles(np.arange(self._mesh.triangle_count))
        self._normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._distances = np.einsum("ij,ij->i", self._normals, corners[:, 0])

    def warm_up(self, rays: Rays) -> None:
        """Compile the pass over planes."""
        nowhere = np.zeros((1, 3), np.float32)
        _plane_depths(np.zeros(1, np.int32), nowhere, nowhere, self._normals, self._distances)

    def cast_block(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Answer:
        prim_id = self._ray.intersects_first(origins, directions).astype(np.int32, copy=False)
        depth = _plane_depths(prim_id, origins, directions, self._normals, self._distances)
        return depth, prim_id.view(np.uint32)  # -1 is a miss, that is MISS

    def answers(self) -> Mapping[str, Answering]:
        """Each answer is one call, which traces in one thread."""
        ray = self._ray

        def count(*rays: NDArray[Any]) -> NDArray[np.int64]:
            return np.bincount(ray.intersects_id(*rays, multiple_hits=True)[1], minlength=len(rays[0]))

        def all_hits(*rays: NDArray[Any]) -> Asked:
            _, of_ray, hit = ray.intersects_location(*rays, multiple_hits=True)
            return of_ray, hit

        return {
            "closest": lambda *rays: ray.intersects_first(*rays),
            "any": lambda *rays: ray.intersects_any(*rays),
            "count": count,
            "all": all_hits,
            "contains": lambda points: ray.contains_points(points),
        }


@keep_on_disk
@njit(nogil=True, error_model="numpy")
def _plane_depths(prim_id, origins, directions, normals, distances):  # type: ignore[no-untyped-def]
    """(N,) float32 ray parameters where rays meet the planes of their triangles, inf for prim_id -1."""
    depth = np.empty(len(prim_id), np.float32)
    for i in range(len(prim_id)):
        face = prim_id[i]
        if face < 0:
            depth[i] = np.inf
        else:
            slope, distance = 0.0, distances[face]
            for axis in range(3):
                slope += normals[face, axis] * directions[i, axis]
                distance -= normals[face, axis] * origins[i, axis]
            depth[i] = distance / slope
    return depth


def _check() -> str | None:
    if not import_module("trimesh").ray.has_embree:
        return f"trimesh finds no embreex and would trace in Python; {wheel_problem() or 'pip install embreex'}"
    return None


TRIMESH = peer_method("trimesh", "trimesh", _check, TrimeshScene)
