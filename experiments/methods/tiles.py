"""Method `tiles`, an ablation: the cells' culling without alignment. Each cell is a small scene, traced per pixel."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.alignment.cells import CellOptions
from atra.compiled.threads import WorkerPool
from atra.embree.device import EmbreeDevice
from atra.embree.filters_kernels import memory_monitor
from atra.embree.packets_kernels import RayGrid, TracedImage
from atra.embree.scene import resolve_packet_width
from atra.embree.workspace import Workspace
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_mesh
from atra.geometry.ray_space import check_range, padded_vertices
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.tracing.budgets import check_memory_budget
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.method import Method as TracingMethod
from atra.tracing.method import Prepared
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, image_ray_grid
from atra.tracing.tracer import Tracer
from experiments.drawing.style import ORANGE
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import Settings
from experiments.methods import options as common
from experiments.methods.tiles_kernels import CellScenes, list_cells, tile_kernel


class EmbreeScenes(EmbreeDevice):
    """Committed Embree scenes; scene k holds the triangles faces[starts[k]] ... faces[starts[k + 1] - 1].

    vertices, faces: as for `EmbreeScene`; all scenes share the vertices, and a hit's prim_id counts from the scene's
    first triangle. starts: (scenes + 1,) int64, ascending. device: as for `EmbreeScene`.

    handles: (scenes,) int64, RTCScene handles for compiled code, 0 = no triangle.

    Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self, vertices: NDArray[np.float32], faces: NDArray[np.uint32], starts: NDArray[np.int64], **device: Any
    ) -> None:
        super().__init__(**device)
        self.handles = np.zeros(len(starts) - 1, np.int64)
        try:
            for k in np.nonzero(np.diff(starts))[0]:
                self.handles[k] = scene = self._new_scene()
                self._add_triangles(scene, vertices, faces[starts[k] : starts[k + 1]])
                self._build(scene)
        except BaseException:
            self.close()
            raise


@dataclass(frozen=True)
class Tiles(TracingMethod):
    """Each cell's frustum-culled triangles in an Embree scene of its own; one ray per pixel, in packets.

    The culling is that of aligned rays, without the shear; so the gains of culling and of alignment can be told apart.
    """

    split: tuple[int, int]
    packet_width: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    memory_budget_bytes: int | None = None

    def __post_init__(self) -> None:
        CellOptions(**{name: value for name, value in vars(self).items() if name != "split"})  # checks them

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return resolve_packet_width(self.packet_width)

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_pinhole(camera, "Tiles")
        Split.of_image(self.split, camera)
        check_range(mesh, camera)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedTiles:
        """Cull and build."""
        return PreparedTiles(self, mesh, camera, pool)


class PreparedTiles(Prepared):
    """A BVH for each cell. geometry: vertices, faces cell by cell, and their prim_ids as records."""

    def __init__(self, method: Tiles, mesh: Mesh, camera: View, pool: WorkerPool) -> None:
        self._camera, self._pool = camera, pool
        self._split = Split.of_image(method.split, camera)
        self._packet_shape = SQUAREST_SHAPE[method.rays_per_packet]
        self._workspaces = [Workspace(method.rays_per_packet, coherent=True) for _ in range(pool.threads)]
        self._cell_starts = np.zeros(self._split.cell_count + 1, np.int64)
        start = perf_counter()
        self.geometry = self._plan(mesh, method)
        self.plan_time_s = perf_counter() - start
        monitor_address = memory_monitor()  # compiled before the clock starts
        start = perf_counter()
        self.scenes = EmbreeScenes(
            self.geometry.vertices, self.geometry.faces, self._cell_starts, build_quality=method.build_quality,
            threads=pool.threads, robust=method.robust, monitor_address=monitor_address,
        )  # fmt: skip
        self.build_time_s = perf_counter() - start

    def _plan(self, mesh: Mesh, method: Tiles) -> AlignedGeometry:
        split, pool = self._split, self._pool
        vertices = padded_vertices(len(mesh.vertices))
        points_pixels, vertices[:] = project_mesh(mesh, self._camera, pool)
        cell = (split.nx, split.ny, split.cell_width, split.cell_height)
        counts = count_kept(pool, points_pixels, mesh, True, cell)
        starts = np.concatenate([[0], np.cumsum(counts)])
        check_memory_budget(int(starts[-1]), split.cell_count, method.build_quality, method.memory_budget_bytes)
        cells = np.empty(int(starts[-1]), np.int64)
        pool.run(lambda _, counter: list_cells(counter, points_pixels, mesh.traced_faces, *cell, starts, cells))
        self._cell_starts[1:] = np.cumsum(np.bincount(cells, minlength=split.cell_count))
        prim_ids = np.repeat(np.arange(mesh.triangle_count), counts)[np.argsort(cells, kind="stable")]
        return AlignedGeometry(vertices, mesh.traced_faces[prim_ids], prim_ids)

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

    def close(self) -> None:
        """Release the BVHs."""
        self.scenes.close()


@dataclass(frozen=True)
class TilesOptions(Settings):
    """Cells and packets."""

    section = "method"
    split_x: int | None = common.split_x_option()
    split_y: int = common.split_y_option()
    packet_width: int | None = common.packet_width_option()
    robust: bool = common.robust_option()


def _make(mesh: Mesh, view: View, options: TilesOptions, tracing: Tracing) -> Tracer:
    tiles = Tiles(common.split_of(options), **common.keywords_of(Tiles, options, tracing))
    return Tracer(mesh, view, tiles, threads=tracing.threads, ties=tracing.ties)


TILES = Method(
    "tiles", "culled tiles", Style(ORANGE, "s"), TilesOptions, _make, __name__, common.resolve_split,
    variant=lambda row: ", ".join(common.say_robust(row)),
)  # fmt: skip
