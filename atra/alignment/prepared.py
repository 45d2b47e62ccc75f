"""Meshes prepared for the cells of an alignment: one BVH of copies or instances, and second passes for the rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions, choose_packet_shape, reference_rays, reference_tiles, row_stride_of
from atra.alignment.second_pass import SecondPass, left_out_tiles
from atra.all_hits.reductions import Reduction
from atra.compiled.threads import WorkerPool
from atra.embree.filters_kernels import memory_monitor
from atra.embree.packets_kernels import TracedImage
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.packets.all_hits import EmbreeAllHits, RayBatch
from atra.packets.filters_kernels import NEAREST_HIT, hit_filter
from atra.packets.loop import Packets, trace_packets
from atra.packets.loop_kernels import FILTERED
from atra.packets.pixel import image_rays
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.rays import SQUAREST_SHAPE


class PreparedCells:
    """What is traced for the cells of an alignment's images; see `Prepared`.

    meshes: one per image; with instances all are one mesh. packet_shape: columns and rows of pixels in a packet.
    row_stride: pixels from one image row to the next, with room for lanes of the last packet past the image.
    workspaces: memory of each thread's packets. geometry: what the first pass traces. second_passes: of each image,
    None where nothing is left out. told: counters of what was prepared.
    """

    def __init__(self, meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions, pool: WorkerPool) -> None:
        self.alignment, self._meshes, self._options, self._pool = alignment, meshes, options, pool
        self.workspaces = [Workspace(options.rays_per_packet, coherent=True) for _ in range(pool.threads)]
        self.packet_shape = choose_packet_shape(options.rays_per_packet, alignment.split, options.packet_rows)
        self.row_stride = row_stride_of(alignment.split, self.packet_shape)
        self._tiles = reference_tiles(alignment.split, self.packet_shape[1])
        # No method: it would keep a reference to this object.
        self._rays = partial(reference_rays, alignment, packet_columns=self.packet_shape[0])
        # Compiled here, before any clock starts.
        self._filter_address = hit_filter(NEAREST_HIT, *self.packet_shape, options.geometry)
        memory_monitor()
        self.second_passes: list[SecondPass | None] = []
        self.told: dict[str, float] = {}
        self.plan_time_s = self.build_time_s = 0.0

    def build(self, geometry: AlignedGeometry) -> None:
        """Build the BVH of the first pass, whose filter writes the pixels of all cells."""
        self.geometry, self.triangle_count = geometry, geometry.copy_count
        alignment, options, mesh = self.alignment, self._options, self._meshes[0]
        cell = alignment.split.cell_width, alignment.split.cell_height
        batch = RayBatch(geometry, options.geometry, self.packet_shape, self._rays, self._tiles, cell)
        batches = partial(ray_batches, batch, mesh, alignment.camera, options)
        shift = sum(float(np.linalg.norm(shears, axis=1).max()) for shears in alignment.shears)
        settings = options.scene_settings
        self._all_hits = EmbreeAllHits(mesh, alignment.camera, batches, self.row_stride, self._pool, settings, shift)
        self.scene = geometry.build(self._pool.threads, filter_address=self._filter_address, **settings)

    def still_serves(self, camera: View) -> bool:
        """Never: copies depend on the camera."""
        return False

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`; of several images one stands below the other."""
        alignment, split, workspaces = self.alignment, self.alignment.split, self.workspaces
        packets = Packets(
            self.scene.address, self.packet_shape, alignment.camera, self._rays(offset), self._tiles,
            (split.cell_width, split.cell_height), FILTERED, self.row_stride, len(alignment.cameras) * split.ny,
        )  # fmt: skip
        trace_packets(packets, workspaces, self._pool, TracedImage(depth, prim_id))
        for number, second_pass in enumerate(self.second_passes):
            if second_pass is not None:
                own = slice(number * split.height, (number + 1) * split.height)
                second_pass.trace(workspaces, offset, depth[own], prim_id[own], self._pool)

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
        self._all_hits.gather(what, offset, images, weights, self.workspaces)

    @property
    def _held(self) -> list[EmbreeScene | EmbreeAllHits]:
        second = [later.scene for later in self.second_passes if later is not None]
        return [self.scene, *second, self._all_hits]

    @property
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for all BVHs."""
        return sum(scene.embree_bytes for scene in self._held)

    @property
    def counters(self) -> Mapping[str, float]:
        """Embree's memory, packets_verified and what was told: see `Tracer.counters`."""
        verified = sum(later.packets_traced for later in self.second_passes if later is not None)
        return {"embree_bytes": self.embree_bytes, "packets_verified": verified, **self.told}

    def close(self) -> None:
        """Release the BVHs."""
        for scene in self._held:
            scene.close()


def ray_batches(first: RayBatch, mesh: Mesh, camera: View, options: CellOptions) -> Iterator[RayBatch]:
    """The reference rays, and one per pixel where there are triangles without copies."""
    yield first
    left_out = first.geometry.left_out[0]
    if left_out is not None:
        tiles = left_out_tiles(mesh, camera, left_out)[0]
        others = np.ones(mesh.triangle_count, np.bool_)
        others[left_out.prim_ids] = False
        plain, shape = plan_plain_geometry(mesh, camera, others), SQUAREST_SHAPE[options.rays_per_packet]
        yield image_rays(plain, camera, shape, tiles, is_alone=camera.width % shape[0] != 0)
