"""Cells: their options, the rays of the reference cell, and the pass that traces these through the geometry of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.alignment.aligned_kernels import aligned_kernel
from atra.alignment.alignment import Alignment
from atra.choices import check_choice, check_flags
from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import Image, RayGrid
from atra.embree.scene import BUILD_QUALITIES, EmbreeScene, resolve_packet_width
from atra.embree.workspace import check_widths
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range
from atra.geometry.split import Split
from atra.tracing.budgets import check_image_size
from atra.tracing.embree import make_workspaces
from atra.tracing.rays import ray_grid, share_direction
from atra.whole_numbers import is_whole_number

GEOMETRIES = ("copied", "instanced")
"""A sheared copy of the triangles per cell, or one Embree instance of the mesh per cell."""


@dataclass(frozen=True, kw_only=True)
class CellOptions:
    """Checked options of tracers with cells: see `AlignedTracer`. Packet rows are checked once the cell is known."""

    packet_width: int | None = None
    packet_rows: int | None = None
    build_quality: str = "medium"
    robust: bool = True
    memory_budget_bytes: int | None = None
    geometry: str = "copied"
    culling: bool = True

    def __post_init__(self) -> None:
        resolve_packet_width(self.packet_width)
        check_choice("build_quality", self.build_quality, BUILD_QUALITIES)
        check_choice("geometry", self.geometry, GEOMETRIES)
        check_flags(robust=self.robust, culling=self.culling)
        budget = self.memory_budget_bytes
        if budget is not None and not (isinstance(budget, (int, float, np.number)) and budget >= 0):
            raise InputError(f"memory_budget_bytes is {budget!r}, expected a number of at least 0, or None for none")
        if self.is_instanced and self.culling:
            raise InputError(
                "geometry is 'instanced' and culling is on, but an instance is all of the mesh or nothing; "
                "set culling=False"
            )

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return resolve_packet_width(self.packet_width)

    @property
    def is_instanced(self) -> bool:
        """Whether every cell is an instance of the mesh."""
        return self.geometry == "instanced"


def check_aligned(meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions) -> None:
    """Raise InputError for what float32 cannot trace, packet rows that a packet or a cell cannot have, and an output
    with too many pixels. meshes: one per image."""
    for mesh, camera in zip(meshes, alignment.cameras, strict=True):
        check_range(mesh, camera)
    split = alignment.split
    packet_shape = choose_packet_shape(options.rays_per_packet, split, options.packet_rows)
    check_image_size(split.height * alignment.image_count, _row_stride(split, packet_shape))


class ReferencePass:
    """Traces the rays of the reference cell for all cells of all images.

    packet_shape: columns and rows of pixels in a packet. row_stride: pixels from one image row to the next, with room
    for lanes of the last packet past the image. workspaces: memory of each thread's packets.
    """

    def __init__(self, alignment: Alignment, options: CellOptions, pool: WorkerPool) -> None:
        self.alignment, self._pool = alignment, pool
        self.packet_shape = choose_packet_shape(options.rays_per_packet, alignment.split, options.packet_rows)
        self.row_stride = _row_stride(alignment.split, self.packet_shape)
        self.workspaces = make_workspaces(alignment.cameras[0], options.rays_per_packet, pool.threads)

    def trace(self, scene: EmbreeScene, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        """Write the nearest hits of all images, one below the other."""
        alignment, camera, workspaces = self.alignment, self.alignment.cameras[0], self.workspaces
        rays, image = reference_rays(alignment, offset), Image(depth, prim_id)
        cell_rows = alignment.image_count * alignment.split.ny
        kernel = aligned_kernel(*self.packet_shape, camera.is_parallel)
        address = scene.address
        for workspace in workspaces:
            workspace.set_row_bytes(depth.strides[0])
        share_direction(workspaces, camera)  # a second pass may have set another image's

        def work(worker: int, counter: int) -> None:
            kernel(counter, address, workspaces[worker].packet, rays, cell_rows, image)

        self._pool.run(work)
        check_widths(workspaces)


def reference_rays(alignment: Alignment, offset: tuple[float, float]) -> RayGrid:
    """The rays that are traced for all cells of an alignment, at a sub-pixel offset."""
    columns = alignment.first_x_pixels + np.arange(alignment.split.cell_width)
    rows = alignment.first_y_pixels + np.arange(alignment.split.cell_height)
    return RayGrid(*ray_grid(alignment.cameras[0], columns + offset[0], rows + offset[1]))


def _row_stride(split: Split, packet_shape: tuple[int, int]) -> int:
    return split.width + -split.cell_width % packet_shape[0]


def choose_packet_shape(packet_width: int, split: Split, packet_rows: int | None = None) -> tuple[int, int]:
    """(columns, rows) of a packet in cells of this size: the fewest idle lanes, then the widest rows.

    Rows must divide the cell's height, because tasks share out the image by rows. packet_rows: rows to take instead.
    Raises InputError if a packet or a cell cannot have them.
    """
    shapes = [(packet_width >> k, 1 << k) for k in range(packet_width.bit_length())]
    fitting = {y: (x, y) for x, y in shapes if split.cell_height % y == 0}
    if packet_rows is not None:
        if not is_whole_number(packet_rows) or packet_rows not in fitting:
            raise InputError(
                f"packet_rows is {packet_rows!r}, expected one of {', '.join(map(str, fitting))} for packets of "
                f"{packet_width} in cells {split.cell_height} pixels high, or None to let the cell decide"
            )
        return fitting[packet_rows]

    def merit(shape: tuple[int, int]) -> tuple[float, int]:
        lanes = -(-split.cell_width // shape[0]) * shape[0]
        return split.cell_width / lanes, shape[0]

    return max(fitting.values(), key=merit)
