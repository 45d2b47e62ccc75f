"""Batches of rays against a mesh, through our own BVH."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.packets_kernels import MISS
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range
from atra.rays.rays import RayHits, Rays
from experiments.classification.bvh.batches import Batch, batch_of
from experiments.classification.bvh.binary import bvh_of
from experiments.classification.bvh.starts import NO_SHAFTS, Shafts
from experiments.classification.bvh.traversal import Traversal
from experiments.classification.options import BvhOptions


@dataclass(frozen=True, eq=False)
class PreparedRays:
    """Rays in the order in which a scene traces them.

    rays: as given, in world space. batch: for kernels, around the mesh's origin. shafts: whose lists rays start from.
    sampling_time_s: seconds to sample which shafts the rays use. order_time_s: seconds to order the rays.
    """

    rays: Rays
    batch: Batch
    shafts: Shafts = NO_SHAFTS
    sampling_time_s: float = 0.0
    order_time_s: float = 0.0

    def from_root(self) -> PreparedRays:
        """The same rays in the same order, starting at the root."""
        return PreparedRays(self.rays, self.batch)


class BvhScene:
    """Closest hits and occlusion of rays that come from no camera, through our own BVH.

        with BvhScene(mesh, BvhOptions(), threads=1) as scene:
            hits = scene.intersect(scene.prepare(atra.Rays(origins, directions)))

    Triangles and `prim_id` are as for `atra.RayScene`. At equal distance the lowest `prim_id` wins. Hits are the same
    to the bit for all options. Raises InputError for a mesh smaller than 1e-9, or farther than 1e11 from the world's
    origin.
    """

    def __init__(self, mesh: Mesh, options: BvhOptions, threads: int | None = None) -> None:
        check_world_range(mesh)
        self.mesh, self.threads = mesh, resolve_threads(threads)
        self._pool = WorkerPool(self.threads)
        start = perf_counter()
        self.bvh = bvh_of(mesh, mesh.local_vertices, self._pool)
        self.build_time_s = perf_counter() - start
        self._traversal = Traversal(self.bvh, options, self._pool)

    @property
    def counters(self) -> Mapping[str, float]:
        """Numbers by name: bvh_bytes, the memory of nodes and blocks."""
        return {"bvh_bytes": self.bvh.bytes}

    def prepare(self, rays: Rays) -> PreparedRays:
        """Rays that count from the mesh's origin, like the vertices that they meet."""
        own = rays.counted_from(self.mesh.origin)
        return PreparedRays(rays, batch_of(own.origins, own.directions, own.tnear, own.tfar))

    def intersect(self, prepared: PreparedRays) -> RayHits:
        """The closest hit of every ray between its `tnear` and `tfar`. prepared: from this scene's `prepare`."""
        t, prim_id = self._answers(prepared)
        self._traversal.trace(prepared.batch, prepared.shafts, t, prim_id)
        return RayHits(t, prim_id, prepared.rays, self.mesh)

    def occluded(self, prepared: PreparedRays) -> NDArray[np.bool_]:
        """(N,) bool: whether a ray hits anything between its `tnear` and `tfar`."""
        t, prim_id = self._answers(prepared)
        self._traversal.trace(prepared.batch, prepared.shafts, t, prim_id, any_hit=True)
        return prim_id != MISS

    def count(self, prepared: PreparedRays, any_hit: bool = False) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """The hits, (N,) uint32 prim_ids, and the traversal counters of `bvh.single`, (COUNTS,) int64."""
        t, prim_id = self._answers(prepared)
        counts = self._traversal.trace(prepared.batch, prepared.shafts, t, prim_id, any_hit, counting=True)
        return prim_id, counts

    def _answers(self, prepared: PreparedRays) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        return np.empty(len(prepared.rays), np.float32), np.empty(len(prepared.rays), np.uint32)

    def close(self) -> None:
        """End the threads."""
        self._pool.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
