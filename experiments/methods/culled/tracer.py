"""An ablation: culling by cells without alignment. Each cell is a small scene, traced per pixel."""

from __future__ import annotations

from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.packets_kernels import Image, RayGrid
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_vertices
from atra.geometry.ray_space import padded_vertices
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.tracing.base import ImageTracer, check_views
from atra.tracing.budgets import check_memory_budget
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.options import CellKeywords, CellOptions, lists_options
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, image_ray_grid
from experiments.methods.culled.scenes import EmbreeScenes
from experiments.methods.culled.tiles_kernels import CellScenes, list_cells, sort_by_cell, tile_kernel


class TiledTracer(ImageTracer):
    """Each cell's frustum-culled triangles in an Embree scene of its own; one ray per pixel, in packets.

    The culling is `AlignedTracer`'s, without the shear; so the gains of culling and of alignment can be told apart.
    split: (nx, ny) cells; nx must divide the width, ny the height. options: see `atra.CellOptions`. Raises InputError
    for a split that does not divide the image, MemoryBudgetError before allocating.
    """

    options_type = CellOptions
    options: CellOptions

    @lists_options(CellOptions)
    def __init__(self, mesh: Mesh, camera: View, split: tuple[int, int], **options: Unpack[CellKeywords]) -> None:
        check_pinhole(camera, "TiledTracer")
        self.split = Split.of_image(split, camera)
        super().__init__(options)
        self._show(mesh, camera)
        self._cell_starts = np.zeros(self.split.cell_count + 1, np.int64)

    def _show(self, mesh: Mesh, camera: View) -> None:
        check_pinhole(camera, "TiledTracer")
        split, views = self.split.of(camera), ((mesh, camera),)
        check_views(views)
        self._show_views(views)
        self.split = split

    def _plan_geometry(self) -> AlignedGeometry:
        mesh, split = self.mesh, self.split
        vertices = padded_vertices(len(mesh.vertices))
        points_pixels, vertices[:] = project_vertices(mesh, self.camera, self._pool)
        cell = (split.nx, split.ny, split.cell_width, split.cell_height)
        counts = count_kept(self._pool, points_pixels, mesh, True, cell)
        starts = np.zeros(mesh.triangle_count + 1, np.int64)
        np.cumsum(counts, out=starts[1:])
        copies = int(starts[-1])
        check_memory_budget(copies, split.cell_count, self.options)
        cells = np.empty(copies, np.int64)
        self._pool.run(lambda _, counter: list_cells(counter, points_pixels, mesh.traced_faces, *cell, starts, cells))
        faces, prim_ids = np.empty((copies, 3), np.uint32), np.empty(copies, np.int64)
        sort_by_cell(starts, cells, mesh.traced_faces, self._cell_starts, faces, prim_ids)
        return AlignedGeometry(vertices, faces, prim_ids)

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeScenes:
        return EmbreeScenes(
            geometry.vertices,
            geometry.faces,
            self._cell_starts,
            build_quality=self.options.build_quality,
            threads=self.threads,
            robust=self.options.robust,
            monitor_address=memory_monitor(),
        )

    def _filter_address(self) -> int:
        return 0

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        assert self.geometry is not None
        assert isinstance(self._scene, EmbreeScenes)
        split, prim_ids = self.split, self.geometry.records
        cells = CellScenes(
            self._scene.handles, self._cell_starts, prim_ids, split.nx, split.cell_width, split.cell_height
        )
        rays, image = RayGrid(*image_ray_grid(self.camera, offset)), Image(depth, prim_id)
        kernel = tile_kernel(*SQUAREST_SHAPE[self.packet_width])

        def work(worker: int, counter: int) -> None:
            kernel(counter, cells, self._workspaces[worker].packet, rays, image)

        self._pool.run(work)
