"""An ablation: culling by cells without alignment. Each cell is a small scene, traced per pixel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.alignment.cells import CellOptions
from atra.compiled.threads import WorkerPool
from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.packets_kernels import RayGrid, TracedImage
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_mesh
from atra.geometry.ray_space import check_range, padded_vertices
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.tracing.budgets import check_memory_budget
from atra.tracing.embree import make_workspaces
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, image_ray_grid
from atra.tracing.tracer import Tracer
from experiments.methods.culled.scenes import EmbreeScenes
from experiments.methods.culled.tiles_kernels import CellScenes, list_cells, sort_by_cell, tile_kernel


@dataclass(frozen=True)
class Tiles:
    """Each cell's frustum-culled triangles in an Embree scene of its own, as a method; one ray per pixel, in packets.

    The culling is that of aligned rays, without the shear; so the gains of culling and of alignment can be told apart.
    """

    split: tuple[int, int]
    options: CellOptions = field(default_factory=CellOptions)

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return self.options.rays_per_packet

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_pinhole(camera, "TiledTracer")
        Split.of_image(self.split, camera)
        check_range(mesh, camera)

    def check_gathering(self, camera: View) -> None:
        """Raise InputError."""
        raise InputError("TiledTracer cannot gather all hits; use RasterTracer, PixelTracer or AlignedTracer")

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedTiles:
        """Cull and build."""
        return PreparedTiles(self, mesh, camera, pool)


class PreparedTiles:
    """A BVH for each cell. geometry: vertices, faces cell by cell, and their prim_ids as records."""

    def __init__(self, method: Tiles, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self._camera, self._pool, options = camera, pool, method.options
        self._split = Split.of_image(method.split, camera)
        self._packet_shape = SQUAREST_SHAPE[options.rays_per_packet]
        self._workspaces = make_workspaces(camera, options.rays_per_packet, pool.threads)
        self._cell_starts = np.zeros(self._split.cell_count + 1, np.int64)
        start = perf_counter()
        self.geometry = self._plan(mesh, options)
        self.plan_time_s = perf_counter() - start
        monitor_address = memory_monitor()  # compiled before the clock starts
        start = perf_counter()
        self.scenes = EmbreeScenes(
            self.geometry.vertices, self.geometry.faces, self._cell_starts, build_quality=options.build_quality,
            threads=pool.threads, robust=options.robust, monitor_address=monitor_address,
        )  # fmt: skip
        self.build_time_s = perf_counter() - start

    def _plan(self, mesh: Mesh, options: CellOptions) -> AlignedGeometry:
        split, pool = self._split, self._pool
        vertices = padded_vertices(len(mesh.vertices))
        points_pixels, vertices[:] = project_mesh(mesh, self._camera, pool)
        cell = (split.nx, split.ny, split.cell_width, split.cell_height)
        counts = count_kept(pool, points_pixels, mesh, True, cell)
        starts = np.zeros(mesh.triangle_count + 1, np.int64)
        np.cumsum(counts, out=starts[1:])
        copies = int(starts[-1])
        check_memory_budget(copies, split.cell_count, options.build_quality, options.memory_budget_bytes)
        cells = np.empty(copies, np.int64)
        pool.run(lambda _, counter: list_cells(counter, points_pixels, mesh.traced_faces, *cell, starts, cells))
        faces, prim_ids = np.empty((copies, 3), np.uint32), np.empty(copies, np.int64)
        sort_by_cell(starts, cells, mesh.traced_faces, self._cell_starts, faces, prim_ids)
        return AlignedGeometry(vertices, faces, prim_ids)

    def still_serves(self, camera: View) -> bool:
        """Never: cells hang on the camera."""
        return False

    @property
    def row_stride(self) -> int:
        """The image's width, pixels."""
        return self._camera.width

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`."""
        split, workspaces = self._split, self._workspaces
        sizes = split.nx, split.cell_width, split.cell_height
        cells = CellScenes(self.scenes.handles, self._cell_starts, self.geometry.records, *sizes)
        rays, image = RayGrid(*image_ray_grid(self._camera, offset)), TracedImage(depth, prim_id)
        kernel = tile_kernel(*self._packet_shape)

        def work(worker: int, counter: int) -> None:
            kernel(counter, cells, workspaces[worker].packet, rays, image)

        self._pool.run(work)

    @property
    def triangle_count(self) -> int:
        """Triangles of all cells."""
        return self.geometry.copy_count

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for all BVHs."""
        return self.scenes.embree_bytes

    @property
    def counters(self) -> Mapping[str, float]:
        """Embree's memory."""
        return {"embree_bytes": self.embree_bytes}

    def close(self) -> None:
        """Release the BVHs."""
        self.scenes.close()


def TiledTracer(
    mesh: Mesh,
    camera: View,
    split: tuple[int, int],
    *,
    threads: int | None = None,
    ties: str = "lowest",
    packet_width: int | None = None,
    build_quality: str = "medium",
    robust: bool = True,
    memory_budget_bytes: int | None = None,
) -> Tracer:
    """A tracer of `Tiles`; arguments as for `AlignedTracer`.

    Raises InputError for a split that does not divide the image, MemoryBudgetError before allocating.
    """
    options = CellOptions(
        packet_width=packet_width, build_quality=build_quality, robust=robust, memory_budget_bytes=memory_budget_bytes
    )
    return Tracer(mesh, camera, Tiles(split, options), threads=threads, ties=ties)
