"""Peer `trimesh`: `mesh.ray.intersects_first`, which runs on embreex."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.compiled.store import keep_on_disk
from atra.embree.library import wheel_problem
from experiments.methods.peers.peer import Answer, PreparedBlocks, RayArrays, peer_method
from experiments.methods.peers.questions import Answering, Asked


@dataclass(frozen=True, eq=False)
class _Planes:
    """normals: (F, 3) float64 of any length. distances: (F,) float64, of each plane from the world's origin, times that
    length."""

    normals: NDArray[np.float64]
    distances: NDArray[np.float64]


class PreparedTrimesh(PreparedBlocks):
    """`mesh.ray.intersects_first(origins, directions)`: copies, scales and normalises the rays and runs embreex.

    Timed: that call, which returns triangles without depth, and one compiled pass that computes the depth
    from planes prepared by `build`; trimesh's own function that returns locations takes longer. The BVH is built by
    every core. Normalising goes through numpy's BLAS, which uses every core whatever `threads` says, unless
    OPENBLAS_NUM_THREADS was set before numpy was imported.
    """

    package = "trimesh"
    interface = "ray.intersects_first on embreex, single rays"
    setting = "robust, its default"
    _planes: _Planes

    def _plan(self) -> None:
        """Make the rays through the pixel centres and the planes of the triangles."""
        super()._plan()
        corners = self.mesh.triangles(np.arange(self.mesh.triangle_count))
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self._planes = _Planes(normals, np.einsum("ij,ij->i", normals, corners[:, 0]))

    def _warm_up(self) -> None:
        nowhere = np.zeros((1, 3), np.float32)
        self._plane_depths(np.zeros(1, np.int32), nowhere, nowhere)

    def _trimesh(self) -> Any:
        import trimesh  # slow to import

        return trimesh.Trimesh(self.mesh.vertices, self.mesh.faces.astype(np.int64), process=False, validate=False)

    def _build_scene(self) -> Any:
        mesh = self._trimesh()
        nowhere = np.zeros((1, 3), np.float32)
        mesh.ray.intersects_first(nowhere, nowhere + 1)  # builds the BVH, which waits for the first query
        return mesh.ray

    def _cast(self, scene: Any, rays: RayArrays) -> Answer:
        def cast(block: RayArrays) -> Answer:
            prim_id = scene.intersects_first(block.origins, block.directions).astype(np.int32, copy=False)
            depth = self._plane_depths(prim_id, block.origins, block.directions)
            return depth, prim_id.view(np.uint32)  # -1 is a miss, that is MISS

        return self._in_blocks(cast, rays)

    def _count(self, scene: Any, rays: RayArrays) -> NDArray[np.integer]:
        """`mesh.ray.intersects_id(..., multiple_hits=True)`, which steps each ray on from hit to hit."""

        def count(block: RayArrays) -> NDArray[np.integer]:
            _, of_ray = scene.intersects_id(block.origins, block.directions, multiple_hits=True)
            return np.bincount(of_ray, minlength=len(block.origins))

        return np.concatenate(list(self._each_block(count, rays)))

    def _thickness(self, scene: Any, rays: RayArrays) -> NDArray[np.floating]:
        """The same hits, each at the depth of its plane, behind or in front of which its ray is inside."""

        def measure(block: RayArrays) -> NDArray[np.floating]:
            hit, of_ray = scene.intersects_id(block.origins, block.directions, multiple_hits=True)
            directions = block.directions[of_ray]
            leaving = np.einsum("ij,ij->i", self._planes.normals[hit], directions) > 0.0
            depth = self._plane_depths(hit.astype(np.int32, copy=False), block.origins[of_ray], directions)
            return np.bincount(of_ray, np.where(leaving, depth, -depth), len(block.origins)).astype(
                np.float64, copy=False
            )

        return np.concatenate(list(self._each_block(measure, rays)))

    def _answers(self, scene: Any) -> Mapping[str, Answering]:
        return _answers(scene)

    def answer_of_stand_in(self, question: str, make: Callable[..., Any]) -> Answering | None:
        """That of `make(trimesh.Trimesh, threads=...)`."""
        return _answers(make(self._trimesh(), threads=self.threads))[question]

    def _plane_depths(
        self, prim_id: NDArray[np.int32], origins: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        return _plane_depths(prim_id, origins, directions, self._planes.normals, self._planes.distances)


def _answers(ray: Any) -> Mapping[str, Answering]:
    """ray: a trimesh mesh's, or what stands in for it. Each answer is one call, which traces in one thread."""

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


TRIMESH = peer_method("trimesh", "trimesh", _check, PreparedTrimesh)
