"""One ray per pixel through the library's own BVH."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.packets_kernels import Image, RayGrid
from atra.exact.ties import TieTiles, coplanar_overlaps, lowest_of_ties, tie_tiles
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, from_eye_space, ray_axes, unseen_from
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.tracing.budgets import check_image_memory
from atra.tracing.geometry import plan_plain_geometry
from atra.tracing.images import images_of, outputs
from atra.tracing.lens_rays import LensRays
from atra.tracing.lifetime import Lifetime, check_same_faces, synchronized
from atra.tracing.rays import SQUAREST_SHAPE, image_ray_grid, pixel_tiles
from experiments.classification.bvh.binary import Bvh, bvh_of
from experiments.classification.bvh.images import Start, image_kernel, lens_kernel
from experiments.classification.bvh.memory import Memory
from experiments.classification.bvh.options import BvhOptions
from experiments.classification.bvh.starts import NO_LISTS, NO_SHAFTS, Shafts


class BvhTracer(Lifetime):
    """One ray per pixel, single or in packets, through a binary BVH of the library's own; without Embree.

    options: see `BvhOptions`. Like `PixelTracer`, it keeps the BVH while the camera turns about its eye. Raises
    InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the eye; MemoryBudgetError
    for an image that exceeds the free memory.
    """

    options_type: ClassVar[type[BvhOptions]] = BvhOptions
    options: BvhOptions
    _start = Start.root
    _takes_lenses = True

    def __init__(self, mesh: Mesh, camera: View, **options: Any) -> None:
        self._set_up(mesh, camera, options)

    def _set_up(self, mesh: Mesh, camera: View, options: Mapping[str, Any]) -> None:
        super().__init__()
        self.options = self.options_type(**options)
        self.packet_width = int(self.options.packet_width)
        self.threads = resolve_threads(self.options.threads)
        self._pool = WorkerPool(self.threads)
        self._memories = [Memory.of(self.packet_width) for _ in range(self.threads)]
        self._bvh: Bvh | None = None
        self._lens_rays = LensRays()
        self._show(mesh, camera)

    def _show(self, mesh: Mesh, camera: View) -> None:
        check_range(mesh, camera, self._takes_lenses)
        check_image_memory(camera.height, camera.width)
        self.mesh, self.camera = mesh, camera
        self._tie_tiles: TieTiles | None = None
        self._tiles = pixel_tiles(camera.width, camera.height)

    @synchronized
    def look(self, camera: View) -> None:
        """As `atra.Tracer.look`."""
        self._check_open()
        before = self.camera
        self._show(self.mesh, camera)
        if self._is_built and not self._still_serves(before):
            self.build()

    @synchronized
    def update(self, mesh: Mesh) -> None:
        """As `atra.Tracer.update`."""
        self._check_open()
        check_same_faces(self.mesh, mesh)
        self._show(mesh, self.camera)
        if self._is_built:
            self.build()

    def _still_serves(self, before: View) -> bool:
        """Whether what is built for the camera before serves the one just taken."""
        camera = self.camera
        serves = camera.eye == before.eye and np.array_equal(from_eye_space(camera), from_eye_space(before))
        if serves:
            self._plan_ties()
        return serves

    def _plan_ties(self) -> None:
        if self.options.ties == "lowest":
            tiles = tie_tiles(self.mesh, self.camera)
            self._tie_tiles = tiles if tiles.any else None

    def _build(self) -> tuple[float, float]:
        if self.options.ties == "lowest":  # once per mesh, so outside the plan's clock
            coplanar_overlaps(self.mesh)
        start = perf_counter()
        self._plan_ties()
        plan_time_s = perf_counter() - start
        return plan_time_s, self._build_trees()

    def _build_trees(self) -> float:
        """Build what rays go through; returns the seconds it took."""
        self._bvh = None  # before another is built: both together may not fit
        start = perf_counter()
        vertices = plan_plain_geometry(self.mesh, self.camera).vertices
        self._bvh = bvh_of(self.mesh, vertices, self._pool, unseen_from(self.camera, self.mesh))
        return perf_counter() - start

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits:
        """As `atra.Tracer.trace`."""
        check_offset(offset)
        with self._in_use():
            return self._trace(offset, out)

    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        camera = self.camera
        depth, prim_id = outputs((camera.height, camera.width), camera.width, images_of(out))
        self._run(offset, Image(depth, prim_id), counting=False)
        if self._tie_tiles is not None:
            directions = None
            if isinstance(camera, LensView):
                directions = self._lens_rays.directions(camera, offset, self._pool)
            lowest_of_ties(self.mesh, camera, self._tie_tiles, offset, prim_id, self._pool, directions)
        return Hits(depth, prim_id, offset, self.mesh, camera, self.threads)

    def count(self, image: Image, offset: tuple[float, float] = (0.5, 0.5)) -> NDArray[np.int64]:
        """Trace a frame into `image` with counting, which is slower; returns the counters of `bvh.single`,
        (COUNTS,) int64.

        Ties stay as found. Raises as `trace` does, and for arrays of another size than the camera's.
        """
        check_offset(offset)
        with self._in_use():
            outputs((self.camera.height, self.camera.width), self.camera.width, (image.depth, image.prim_id))
            for memory in self._memories:
                memory.counts[:] = 0
            self._run(offset, image, counting=True)
            return np.sum([memory.counts for memory in self._memories], axis=0)

    def _run(self, offset: tuple[float, float], image: Image, counting: bool) -> None:
        assert self._bvh is not None
        shape, camera, tree = SQUAREST_SHAPE[self.packet_width], self.camera, self._bvh.tree
        push, robust = self.options.traversal == "push", self.options.robust
        if isinstance(camera, LensView):
            table = self._lens_rays.table(camera, offset, self._pool)
            trace_lens = lens_kernel(*shape, push, counting, robust)
            given = tree, table, NO_LISTS, self._tiles, image
            self._pool.run(lambda worker, counter: trace_lens(counter, *given, self._memories[worker]))
            return
        rays, shared, shafts = RayGrid(*image_ray_grid(camera, offset, shape)), self._shared, self._shafts
        kernel = image_kernel(*shape, push, counting, robust, camera.is_parallel, self._start)

        def work(worker: int, counter: int) -> None:
            kernel(counter, tree, rays, shared, self._tiles, image, shafts, self._memories[worker])

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
        return self.mesh.triangle_count

    @property
    def embree_bytes(self) -> int:
        """0: there is no Embree."""
        return 0

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]:
        """The one mesh and camera."""
        return ((self.mesh, self.camera),)

    @property
    @synchronized
    def counters(self) -> Mapping[str, float]:
        """As `atra.Tracer` says; known are triangles_traced and bvh_bytes, the memory of nodes and blocks."""
        return {"triangles_traced": self.triangle_count, "bvh_bytes": 0 if self._bvh is None else self._bvh.bytes}

    def _release(self) -> None:
        self._pool.close()
        self._bvh = None
