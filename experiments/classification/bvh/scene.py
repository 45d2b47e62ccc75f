"""Batches of rays against a mesh, through the library's own BVH."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.packets_kernels import MISS
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range
from atra.rays.rays import RayHits, Rays
from atra.tracing.lifetime import Lifetime, check_same_faces, synchronized
from experiments.classification.bvh.batches import Batch, batch_kernel
from experiments.classification.bvh.binary import Bvh, bvh_of
from experiments.classification.bvh.memory import Memory
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.starts import NO_SHAFTS, ROOT_LIST, Shafts


@dataclass(frozen=True, eq=False)
class PreparedRays:
    """Rays in the order in which a scene traces them.

    rays: in float32, around the mesh's origin. batch: the same for kernels. shafts: whose lists the rays start from.
    sampling_time_s: seconds to sample which shafts the rays use. order_time_s: seconds to order the rays. given: the
    rays in world space.
    """

    rays: Rays
    batch: Batch
    shafts: Shafts
    sampling_time_s: float = 0.0
    order_time_s: float = 0.0
    given: Rays | None = None

    def from_root(self, width: int) -> PreparedRays:
        """The same rays in the same order, in full packets of `width` that start at the root."""
        return PreparedRays(self.rays, batch_of(self.rays, width, self.batch.order), NO_SHAFTS, given=self.given)


class BvhScene(Lifetime):
    """Closest hits and occlusion for arbitrary rays, through a binary BVH of the library's own.

        with BvhScene(mesh) as scene:
            hits = scene.intersect(scene.prepare(atra.Rays(origins, directions)))

    options: see `BvhOptions`; a packet holds consecutive rays of the batch. Triangles and `prim_id` are as for
    `atra.RayScene`. At equal distance the lowest `prim_id` wins. Hits are the same to the bit for all options. Raises
    InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the world's origin.
    """

    options_type: ClassVar[type[BvhOptions]] = BvhOptions
    options: BvhOptions

    def __init__(self, mesh: Mesh, **options: Any) -> None:
        self._set_up(mesh, options)

    def _set_up(self, mesh: Mesh, options: Mapping[str, Any]) -> None:
        super().__init__()
        self._take(mesh)
        self.options = self.options_type(**options)
        self.packet_width = int(self.options.packet_width)
        self.threads = resolve_threads(self.options.threads)
        self._pool = WorkerPool(self.threads)
        self._memories = [Memory.of(self.packet_width) for _ in range(self.threads)]
        self._bvh: Bvh | None = None

    @property
    def bvh(self) -> Bvh:
        """The BVH. Raises ClosedError after `close`."""
        with self._in_use():
            return self._bvh  # type: ignore[return-value]

    def _take(self, mesh: Mesh) -> None:
        check_world_range(mesh)
        self.mesh = mesh

    @synchronized
    def update(self, mesh: Mesh) -> None:
        """As `atra.Tracer.update`."""
        self._check_open()
        check_same_faces(self.mesh, mesh)
        self._take(mesh)
        if self._is_built:
            self.build()

    def _build(self) -> tuple[float, float]:
        return 0.0, self._build_trees()

    def _build_trees(self) -> float:
        """Build what rays go through; returns the seconds it took."""
        start = perf_counter()
        self._bvh = bvh_of(self.mesh, self.mesh.local_vertices, self._pool)
        return perf_counter() - start

    @property
    @synchronized
    def counters(self) -> Mapping[str, float]:
        """Numbers by name: bvh_bytes, the memory of nodes and blocks."""
        return {"bvh_bytes": 0 if self._bvh is None else self._bvh.bytes}

    def prepare(self, rays: Rays) -> PreparedRays:
        """Order rays into packets. Raises ClosedError after `close`."""
        with self._in_use():
            own = self._own(rays)
            return PreparedRays(own, batch_of(own, self.packet_width), NO_SHAFTS, given=rays)

    def _own(self, rays: Rays) -> Rays:
        """Rays in float32 that count from the mesh's origin, like the vertices that they meet."""
        own = rays.counted_from(self.mesh.origin)
        if own.origins.dtype == np.float32:
            return own
        with np.errstate(over="ignore", under="ignore"):
            return Rays(*(array.astype(np.float32) for array in (own.origins, own.directions, own.tnear, own.tfar)))

    def intersect(self, prepared: PreparedRays, out: RayHits | None = None) -> RayHits:
        """The closest hit of every ray between its `tnear` and `tfar`.

        prepared: from this scene's `prepare`. out: an earlier result for as many rays, overwritten. Raises ClosedError
        after `close`.
        """
        count = len(prepared.rays)
        t = np.empty(count, np.float32) if out is None else out.t
        prim_id = np.empty(count, np.uint32) if out is None else out.prim_id
        with self._in_use():
            self._run(prepared, t, prim_id, any_hit=False, counting=False)
            given = prepared.given if prepared.given is not None and self.mesh.has_origin else prepared.rays
            return RayHits(t, prim_id, given, self.mesh)

    def occluded(self, prepared: PreparedRays) -> NDArray[np.bool_]:
        """(N,) bool: whether a ray hits anything between its `tnear` and `tfar`. Raises as `intersect`."""
        t, prim_id = np.empty(len(prepared.rays), np.float32), np.empty(len(prepared.rays), np.uint32)
        self._run(prepared, t, prim_id, any_hit=True, counting=False)
        return prim_id != MISS

    def count(self, prepared: PreparedRays, any_hit: bool = False) -> tuple[NDArray[np.uint32], NDArray[np.int64]]:
        """The hits, (N,) uint32 prim_ids, and the traversal counters of `bvh.single`, (COUNTS,) int64."""
        t, prim_id = np.empty(len(prepared.rays), np.float32), np.empty(len(prepared.rays), np.uint32)
        with self._in_use():
            for memory in self._memories:
                memory.counts[:] = 0
            self._run(prepared, t, prim_id, any_hit=any_hit, counting=True)
            return prim_id, np.sum([memory.counts for memory in self._memories], axis=0)

    def _run(
        self,
        prepared: PreparedRays,
        t: NDArray[np.float32],
        prim_id: NDArray[np.uint32],
        *,
        any_hit: bool,
        counting: bool,
    ) -> None:
        push, shafts, batch = self.options.traversal == "push", prepared.shafts, prepared.batch
        kernel = batch_kernel(self.packet_width, push, any_hit, counting, self.options.robust, shafts is not NO_SHAFTS)
        with self._in_use():
            tree = self.bvh.tree

            def work(worker: int, counter: int) -> None:
                kernel(counter, tree, batch, shafts, t, prim_id, self._memories[worker])

            self._pool.run(work)

    def _release(self) -> None:
        self._pool.close()
        self._bvh = None


def batch_of(
    rays: Rays,
    width: int,
    order: NDArray[np.int64] | None = None,
    starts: NDArray[np.int64] | None = None,
    lists: NDArray[np.int64] | None = None,
) -> Batch:
    """Rays as kernels read them. order: None keeps the given order. starts: where packets start; None: every `width`
    rays. lists: where each packet's list starts; None: at the root's."""
    count = len(rays)
    starts = np.arange(0, count, width) if starts is None else starts
    return Batch(
        rays.origins,
        rays.directions,
        rays.tnear,
        rays.tfar,
        np.arange(count) if order is None else order,
        np.append(starts, count),
        np.full(len(starts), ROOT_LIST) if lists is None else lists,
    )
