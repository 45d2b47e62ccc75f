"""The paper's method: trace the reference cell's rays through the geometry of all cells, sheared onto them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import REFERENCES, Alignment
from atra.alignment.cells import CellOptions, ReferencePass, check_aligned, reference_rays
from atra.alignment.culling import plan_aligned_geometry
from atra.alignment.instancing import check_instancing_budget, plan_instanced_geometry
from atra.alignment.second_pass import SECOND_PASS_TILE, SecondPass, left_out_passes
from atra.alignment.visibility import Tiles, nearest_in_tiles
from atra.all_hits.reductions import Reduction
from atra.choices import check_choice
from atra.compiled.threads import WorkerPool
from atra.embree.callbacks_kernels import memory_monitor, nearest_hit_filter
from atra.embree.packets_kernels import PixelTiles
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.packets.all_hits import EmbreeAllHits, RayBatch, check_gathering
from atra.packets.pixel import image_rays
from atra.tracing.budgets import check_memory_budget
from atra.tracing.embree import build_scene
from atra.tracing.geometry import AlignedGeometry, LeftOut, plan_plain_geometry
from atra.tracing.rays import SQUAREST_SHAPE, longest_ray
from atra.tracing.tracer import Tracer


@dataclass(frozen=True)
class Aligned:
    """Affine-transformed ray alignment as a method. split, reference: see `AlignedTracer`; options: its others."""

    split: tuple[int, int]
    reference: str = "off_axis"
    options: CellOptions = field(default_factory=CellOptions)

    def __post_init__(self) -> None:
        check_choice("reference", self.reference, REFERENCES)

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return self.options.rays_per_packet

    def alignment(self, camera: View) -> Alignment:
        """The cells of a camera's image. Raises InputError for a split that does not divide it."""
        return Alignment.of_cells(camera, Split.of_image(self.split, camera), self.reference)

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        alignment = self.alignment(camera)
        check_aligned((mesh,), alignment, self.options)
        check_copies((mesh,), alignment, self.options)

    def check_gathering(self, camera: View) -> None:
        """See `Method.check_gathering`."""
        check_gathering(camera, self.options.build_quality)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedAligned:
        """Cull, shear and build."""
        return PreparedAligned((mesh,), self.alignment(camera), self.options, pool)


def check_copies(meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions) -> None:
    """Raise MemoryBudgetError for more copies or instances than the memory holds, where their number is known."""
    cells = alignment.split.cell_count * alignment.image_count
    if options.is_instanced:
        check_instancing_budget(meshes[0], cells, options)
    elif not options.culling:
        copies = sum(mesh.triangle_count for mesh in meshes) * alignment.split.cell_count
        check_memory_budget(copies, cells, options.build_quality, options.memory_budget_bytes)


class PreparedAligned:
    """A BVH of sheared copies, or instances, for all cells of the images of an alignment.

    meshes: one per image; with instances all are one mesh. packet_shape: columns and rows of pixels in a packet.
    """

    def __init__(self, meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions, pool: WorkerPool) -> None:
        self._meshes, self._options, self._pool = meshes, options, pool
        self._pass = ReferencePass(alignment, options, pool)
        self.packet_shape, self.row_stride = self._pass.packet_shape, self._pass.row_stride
        self._all_hits: EmbreeAllHits | None = None
        start = perf_counter()
        self.geometry = self._plan()
        self.plan_time_s = perf_counter() - start
        filter_address = nearest_hit_filter(*self.packet_shape, options.is_instanced)
        memory_monitor()  # compiled, like the filter, before the clock starts
        start = perf_counter()
        self.second_passes = left_out_passes(meshes, alignment, self.geometry.left_out, options, pool)
        self._scene = build_scene(self.geometry, pool.threads, filter_address=filter_address, **self._settings)
        self.build_time_s = perf_counter() - start

    def _plan(self) -> AlignedGeometry:
        rest = self._pass.alignment, self._options, self.row_stride, self._pool
        if self._options.is_instanced:
            return plan_instanced_geometry(self._meshes[0], *rest)
        return plan_aligned_geometry(self._meshes, *rest)

    @property
    def _settings(self) -> dict[str, Any]:
        return {"build_quality": self._options.build_quality, "robust": self._options.robust}

    def still_serves(self, camera: View) -> bool:
        """Never: copies hang on the camera."""
        return False

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`; of several images one stands below the other."""
        self._pass.trace(self._scene, offset, depth, prim_id)
        height = self._pass.alignment.split.height
        for image, second_pass in enumerate(self.second_passes):
            if second_pass is not None:
                rows = slice(image * height, (image + 1) * height)
                second_pass.trace(self._pass.workspaces, offset, depth[rows], prim_id[rows])

    @property
    def gathering_stride(self) -> int:
        """Pixels from one row of gathered images to the next: that of the records."""
        return self.row_stride

    def gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        """See `Gathering.gather`; of one image. The first call builds BVHs with a filter."""
        if self._all_hits is None:
            from atra.raster.all_hits.undecided_kernels import Precision

            (mesh,), alignment = self._meshes, self._pass.alignment
            (camera,) = alignment.cameras
            direction, origin = longest_ray(camera)
            shift = sum(float(np.linalg.norm(shears, axis=1).max()) for shears in alignment.shears)
            stretch, shift = (1.0, origin + shift) if camera.is_parallel else (1.0 + shift, 0.0)
            precision = Precision(camera.pixel_pitch, direction, stretch, shift, self._options.robust)
            self._all_hits = EmbreeAllHits(
                mesh, camera, self._ray_batches(), self.gathering_stride, precision, self._pool, **self._settings
            )
        self._all_hits.gather(what, offset, images, weights, self._pass.workspaces)

    def _ray_batches(self) -> list[RayBatch]:
        """The reference rays, and those of pixels where triangles were left out."""
        alignment, shape = self._pass.alignment, self.packet_shape
        split = alignment.split
        strips = np.zeros((split.cell_height // shape[1], 2), np.int32)
        strips[:, 1] = np.arange(0, split.cell_height, shape[1])
        tiles, cell = PixelTiles(strips, split.cell_width, shape[1]), (split.cell_width, split.cell_height)
        rays = partial(reference_rays, alignment)  # no method: it would keep a reference to this object
        batches = [RayBatch(self.geometry, self._options.geometry, shape, rays, tiles, cell)]
        left_out = [one for one in self.geometry.left_out if one is not None]
        return batches + [self._left_out_rays(one) for one in left_out]

    def _left_out_rays(self, left_out: LeftOut) -> RayBatch:
        """The rays of the second pass, in the tiles where triangles were left out."""
        (mesh,), (camera,) = self._meshes, self._pass.alignment.cameras
        shape = SQUAREST_SHAPE[self._options.rays_per_packet]
        tiles = Tiles(*SECOND_PASS_TILE, camera.width, camera.height)
        rows, columns = np.nonzero(np.isfinite(nearest_in_tiles(mesh, camera, tiles, left_out)))
        corners = np.stack([columns * tiles.tile_width, rows * tiles.tile_height], axis=1).astype(np.int32)
        others = np.ones(mesh.triangle_count, np.bool_)
        others[left_out.prim_ids] = False
        plain = plan_plain_geometry(mesh, camera, others)
        image_tiles = PixelTiles(corners, tiles.tile_width, tiles.tile_height)
        return image_rays(plain, camera, shape, image_tiles, is_alone=camera.width % shape[0] != 0)

    @property
    def triangle_count(self) -> int:
        """Copies in the Embree scene; with instances the mesh's own triangles."""
        return self.geometry.copy_count

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for all BVHs."""
        second = sum(one.scene.embree_bytes for one in self._built_second_passes)
        return self._scene.embree_bytes + second + (0 if self._all_hits is None else self._all_hits.embree_bytes)

    @property
    def counters(self) -> Mapping[str, float]:
        """Embree's memory, triangles_left_out and packets_verified: see `Tracer.counters`."""
        return {
            "embree_bytes": self.embree_bytes,
            "triangles_left_out": sum(len(one.prim_ids) for one in self.geometry.left_out if one is not None),
            "packets_verified": sum(one.packets_traced for one in self._built_second_passes),
        }

    @property
    def _built_second_passes(self) -> list[SecondPass]:
        return [one for one in self.second_passes if one is not None]

    def close(self) -> None:
        """Release the BVHs."""
        if self._all_hits is not None:
            self._all_hits.close()
        for second_pass in self._built_second_passes:
            second_pass.close()
        self._scene.close()


def AlignedTracer(
    mesh: Mesh,
    camera: View,
    split: tuple[int, int],
    *,
    threads: int | None = None,
    ties: str = "lowest",
    packet_width: int | None = None,
    packet_rows: int | None = None,
    build_quality: str = "medium",
    robust: bool = True,
    memory_budget_bytes: int | None = None,
    geometry: str = "copied",
    culling: bool = True,
    reference: str = "off_axis",
) -> Tracer:
    """Trace the reference cell's rays and get the nearest hit of every cell: affine-transformed ray alignment.

    Parameters
    ----------
    mesh, camera :
        What is traced, and by which rays: pinhole or orthographic.
    split : (int, int)
        Columns and rows of cells; they must divide the image's width and height.
    threads, ties :
        As for `Tracer`.
    packet_width : {1, 4, 8, 16}, optional
        Rays in a packet; 1 = single rays (default: the widest native packets).
    packet_rows : int, optional
        Rows of pixels in a packet (default: the best fit for the cell).
    build_quality : {"low", "medium", "high"}
        Embree's, for its BVH.
    robust : bool
        No ray slips through between two triangles; False takes Embree's fast arithmetic, as in the paper.
    memory_budget_bytes : int, optional
        Copies that need more are refused (default: the memory that is free).
    geometry : {"copied", "instanced"}
        A sheared copy of the triangles per cell, or one Embree instance of the mesh per cell, which needs
        `culling=False`; `triangle_count` is then the mesh's own.
    culling : bool
        Copy only the triangles that a cell's frustum meets.
    reference : {"off_axis", "first_cell"}
        The reference cell: a quarter of the image from its centre, or the first cell, as in the paper. The image is the
        same.

    Returns
    -------
    Tracer

    Raises
    ------
    InputError
        For a split that does not divide the image, and an option's value.
    MemoryBudgetError
        For more copies than the memory holds, before they are made.

    Notes
    -----
    Source: paper §3.1 and §3.4; instances §4.4.
    """
    options = CellOptions(
        packet_width=packet_width, packet_rows=packet_rows, build_quality=build_quality, robust=robust,
        memory_budget_bytes=memory_budget_bytes, geometry=geometry, culling=culling,
    )  # fmt: skip
    return Tracer(mesh, camera, Aligned(split, reference, options), threads=threads, ties=ties)
