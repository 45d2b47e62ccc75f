"""One ray per pixel through our own BVH, from its root or from the lists of shafts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, from_eye_space, ray_axes, unseen_from
from atra.geometry.view import View
from atra.tracing.geometry import plan_plain_geometry
from atra.tracing.method import Method, Prepared
from atra.tracing.rays import image_ray_grid, pixel_tiles
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.batches import Batch, batch_of
from experiments.classification.bvh.binary import bvh_of
from experiments.classification.bvh.starts import NO_SHAFTS
from experiments.classification.bvh.traversal import Traversal
from experiments.classification.options import OF_RAYS, BvhOptions, ClassifiedOptions
from experiments.classification.shafts.shafts import build_shafts


class PreparedBvh(Prepared):
    """A mesh's BVH in ray space, which serves while the camera turns about its eye, and the rays of an image."""

    def __init__(self, options: BvhOptions, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self._camera, self._triangle_count, self._batches = camera, mesh.triangle_count, dict[object, Batch]()
        start = perf_counter()
        bvh = bvh_of(mesh, plan_plain_geometry(mesh, camera).vertices, pool, unseen_from(camera, mesh))
        self.lists = build_shafts(bvh, options, pool) if isinstance(options, ClassifiedOptions) else None
        self.build_time_s = perf_counter() - start
        self._traversal = Traversal(bvh, options, pool)

    def still_serves(self, camera: View) -> bool:
        """Take a camera with the same eye and the same ray space."""
        before = self._camera
        serves = camera.eye == before.eye and np.array_equal(from_eye_space(camera), from_eye_space(before))
        if serves:
            self._camera, self._batches = camera, {}
        return serves

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        self.count(offset, depth, prim_id, counting=False)

    def count(
        self,
        offset: tuple[float, float],
        depth: NDArray[np.float32],
        prim_id: NDArray[np.uint32],
        counting: bool = True,
    ) -> NDArray[np.int64]:
        """Draw, and return the counters of `bvh.single`, (COUNTS,) int64; counting is slower."""
        if offset not in self._batches:
            self._batches = {offset: _image_batch(self._camera, offset)}
        shafts = NO_SHAFTS if self.lists is None else self.lists.shafts
        images = depth.reshape(-1), prim_id.reshape(-1)
        return self._traversal.trace(self._batches[offset], shafts, *images, counting=counting)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh."""
        return self._triangle_count

    @property
    def counters(self) -> Mapping[str, float]:
        """bvh_bytes, the memory of nodes and blocks, and numbers of the shafts."""
        shafts = {} if self.lists is None else self.lists.counters
        return {"bvh_bytes": self._traversal.bvh.bytes, **shafts}


def _image_batch(camera: View, offset: tuple[float, float]) -> Batch:
    """The rays of all pixels in ray space, tile by tile."""
    columns, rows = image_ray_grid(camera, offset)
    grid = (columns[:, None, :] + rows[:, :, None]).reshape(3, -1).T
    origins, directions = np.zeros_like(grid), grid
    if camera.is_parallel:
        origins, directions = grid, np.broadcast_to(ray_axes(camera)[2], grid.shape)
    y, x = np.divmod(np.arange(len(grid)), camera.width)
    tiles = pixel_tiles(camera.width, camera.height)
    order = np.lexsort((x, y, x // tiles.width, y // tiles.height))
    return batch_of(origins, directions, np.zeros(len(grid)), np.full(len(grid), np.inf), order)


@dataclass(frozen=True)
class OwnBvh(Method):
    """Rays through our own BVH as a method; from the lists of their shafts, if the options are of these."""

    options: BvhOptions

    @property
    def rays_per_packet(self) -> int:
        """1."""
        return 1

    def check(self, mesh: Mesh, camera: View) -> None:
        """Raise InputError for a mesh smaller than 1e-9 or farther than 1e11 from the eye, a lens, and shafts that no
        image has."""
        check_range(mesh, camera)
        if isinstance(self.options, ClassifiedOptions):
            subset = self.options.shaft_subset
            if subset in OF_RAYS:
                raise InputError(f"shaft_subset is {subset!r}, which depends on rays; expected another for a camera")

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedBvh:
        """Build."""
        return PreparedBvh(self.options, mesh, camera, pool)


def BvhTracer(
    mesh: Mesh, camera: View, options: BvhOptions | None = None, *, threads: int | None = None, ties: str = "lowest"
) -> Tracer:
    """One ray per pixel through our own binary BVH; without Embree.

    options: None = from the root; `ClassifiedOptions` = each ray from the list of its shaft. Like
    `atra.PixelTracer`, it keeps the BVH while the camera turns about its eye. Raises InputError as `OwnBvh.check`;
    MemoryBudgetError for an image, and when building for shafts, that exceed the free memory. Source: J. Hendrich et
    al., "Ray classification for accelerated BVH traversal", 2019.
    """
    return Tracer(mesh, camera, OwnBvh(options or BvhOptions()), threads=threads, ties=ties)
