"""One ray per pixel through the library's own BVH."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import RayGrid, TracedImage
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, from_eye_space, ray_axes, unseen_from
from atra.geometry.view import View
from atra.tracing.geometry import plan_plain_geometry
from atra.tracing.images import outputs
from atra.tracing.lens_rays import LensRays
from atra.tracing.method import Method, Prepared
from atra.tracing.rays import SQUAREST_SHAPE, image_ray_grid, pixel_tiles
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.binary import Bvh, bvh_of
from experiments.classification.bvh.images import Start, image_kernel, lens_kernel
from experiments.classification.bvh.memory import Memory
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.starts import NO_LISTS, NO_SHAFTS, Shafts


class PreparedBvh(Prepared):
    """A mesh's BVH in ray space, which serves while the camera turns about its eye. start: where rays start in it."""

    start: ClassVar[Start] = Start.root
    bvh: Bvh

    def __init__(self, options: Any, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self.options, self._mesh, self._pool = options, mesh, pool
        self._memories = [Memory.of(options.packet_width) for _ in range(pool.threads)]
        self._lens_rays = LensRays()
        self._take(camera)
        start = perf_counter()
        self._build()
        self.build_time_s = perf_counter() - start

    def _build(self) -> None:
        """Build what rays go through."""
        vertices = plan_plain_geometry(self._mesh, self.camera).vertices
        self.bvh = bvh_of(self._mesh, vertices, self._pool, unseen_from(self.camera, self._mesh))

    def _take(self, camera: View) -> None:
        self.camera, self.tiles = camera, pixel_tiles(camera.width, camera.height)

    def still_serves(self, camera: View) -> bool:
        """Take a camera with the same eye and the same ray space."""
        before = self.camera
        serves = camera.eye == before.eye and np.array_equal(from_eye_space(camera), from_eye_space(before))
        if serves:
            self._take(camera)
        return serves

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        self._run(offset, TracedImage(depth, prim_id), counting=False)

    def count(self, image: TracedImage, offset: tuple[float, float] = (0.5, 0.5)) -> NDArray[np.int64]:
        """Trace a frame into `image` with counting, which is slower; returns the counters of `bvh.single`,
        (COUNTS,) int64. Ties stay as found. Raises InputError for arrays of another size than the camera's."""
        outputs((self.camera.height, self.camera.width), self.camera.width, (image.depth, image.prim_id))
        for memory in self._memories:
            memory.counts[:] = 0
        self._run(offset, image, counting=True)
        return np.sum([memory.counts for memory in self._memories], axis=0)

    def _run(self, offset: tuple[float, float], image: TracedImage, counting: bool) -> None:
        shape, camera, tree = SQUAREST_SHAPE[self.options.packet_width], self.camera, self.bvh.tree
        push, robust = self.options.traversal == "push", self.options.robust
        if isinstance(camera, LensView):
            table = self._lens_rays.table(camera, offset, self._pool)
            trace_lens = lens_kernel(*shape, push, counting, robust)
            given = tree, table, NO_LISTS, self.tiles, image
            self._pool.run(lambda worker, counter: trace_lens(counter, *given, self._memories[worker]))
            return
        rays, shared, shafts = RayGrid(*image_ray_grid(camera, offset, shape)), self._shared, self._shafts
        kernel = image_kernel(*shape, push, counting, robust, camera.is_parallel, self.start)

        def work(worker: int, counter: int) -> None:
            kernel(counter, tree, rays, shared, self.tiles, image, shafts, self._memories[worker])

        self._pool.run(work)

    @property
    def _shafts(self) -> Shafts:
        return NO_SHAFTS

    @property
    def _shared(self) -> NDArray[np.float32]:
        """(3,) float32: the direction of parallel rays, or the eye where rays start there."""
        return ray_axes(self.camera)[2].astype(np.float32)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self._mesh.triangle_count

    @property
    def counters(self) -> Mapping[str, float]:
        """bvh_bytes: the memory of nodes and blocks."""
        return {"bvh_bytes": self.bvh.bytes}


@dataclass(frozen=True)
class OwnBvh(Method):
    """Rays through a BVH of the library's own as a method. prepared: what rays start from decides."""

    options: BvhOptions

    prepared: ClassVar[type[PreparedBvh]] = PreparedBvh

    @property
    def rays_per_packet(self) -> int:
        """The packet width."""
        return self.options.packet_width

    def check(self, mesh: Mesh, camera: View) -> None:
        """Raise InputError for a mesh smaller than 1e-9 or farther than 1e11 from the eye."""
        check_range(mesh, camera, takes_lenses=True)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedBvh:
        """Build."""
        return self.prepared(self.options, mesh, camera, pool)

    def tracer(self, mesh: Mesh, camera: View) -> Tracer:
        """The tracer with the threads and the rule for ties of the options."""
        return Tracer(mesh, camera, self, threads=self.options.threads, ties=self.options.ties)


def BvhTracer(mesh: Mesh, camera: View, **options: Any) -> Tracer:
    """One ray per pixel, single or in packets, through a binary BVH of the library's own; without Embree.

    options: fields of `BvhOptions`. Like `PixelTracer`, it keeps the BVH while the camera turns about its eye. Raises
    InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the eye; MemoryBudgetError
    for an image that exceeds the free memory.
    """
    return OwnBvh(BvhOptions(**options)).tracer(mesh, camera)
