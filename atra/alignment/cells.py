"""Cells: their options and checks, the rays of the reference cell, and the shape of their packets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from atra.alignment.alignment import Alignment
from atra.choices import check_choice, check_flags
from atra.embree.packets_kernels import PixelTiles, RayGrid
from atra.embree.scene import BUILD_QUALITIES, resolve_packet_width
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range
from atra.geometry.split import Split
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, check_image_size, check_memory_budget, check_needed_bytes
from atra.tracing.rays import ray_grid
from atra.whole_numbers import is_whole_number

GEOMETRIES = ("copied", "instanced")
"""A sheared copy of the triangles per cell, or one Embree instance of the mesh per cell."""

BYTES_PER_INSTANCE = 48 + 8 + 600
"""A transform, a record, and the growth of the process at the peak of a build, rounded up."""


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

    @property
    def scene_settings(self) -> dict[str, Any]:
        """What `AlignedGeometry.build` is told."""
        return {"build_quality": self.build_quality, "robust": self.robust}


def check_aligned(meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions) -> None:
    """Raise InputError for what float32 cannot trace, packet rows that a packet or a cell cannot have, and an output
    with too many pixels; MemoryBudgetError for more copies or instances than the memory holds, where culling does not
    decide their number. meshes: one per image."""
    for mesh, camera in zip(meshes, alignment.cameras, strict=True):
        check_range(mesh, camera)
    split, images = alignment.split, len(alignment.cameras)
    packet_shape = choose_packet_shape(options.rays_per_packet, split, options.packet_rows)
    check_image_size(split.height * images, row_stride_of(split, packet_shape))
    cells, mesh = split.cell_count * images, meshes[0]
    if options.is_instanced:
        needed = len(mesh.vertices) * 12 + mesh.triangle_count * EMBREE_BYTES_PER_COPY[options.build_quality]
        needed += cells * BYTES_PER_INSTANCE
        what = f"{mesh.triangle_count:,} triangles and {cells:,} instances of them"
        check_needed_bytes(needed, options.memory_budget_bytes, what, "use fewer cells or more memory")
    elif not options.culling:
        copies = sum(mesh.triangle_count for mesh in meshes) * split.cell_count
        check_memory_budget(copies, cells, options.build_quality, options.memory_budget_bytes)


def reference_rays(alignment: Alignment, offset: tuple[float, float], packet_columns: int = 1) -> RayGrid:
    """The rays that are traced for all cells of an alignment, at a sub-pixel offset, filled up to whole packets."""
    (x, y), split = alignment.corner_pixels, alignment.split
    columns, rows = np.arange(split.cell_width + -split.cell_width % packet_columns), np.arange(split.cell_height)
    return ray_grid(alignment.camera, x + columns + offset[0], y + rows + offset[1])


def reference_tiles(split: Split, packet_rows: int) -> PixelTiles:
    """The reference cell in strips as high as a packet."""
    strips = np.zeros((split.cell_height // packet_rows, 2), np.int32)
    strips[:, 1] = np.arange(0, split.cell_height, packet_rows)
    return PixelTiles(strips, split.cell_width, packet_rows)


def row_stride_of(split: Split, packet_shape: tuple[int, int]) -> int:
    """Pixels from one image row to the next, with room for lanes of the last packet past the image."""
    return split.width + -split.cell_width % packet_shape[0]


def choose_packet_shape(packet_width: int, split: Split, packet_rows: int | None = None) -> tuple[int, int]:
    """(columns, rows) of a packet in cells of this size: the fewest idle lanes, then the widest rows.

    Rows must divide the cell's height, because tasks share out the image by rows. packet_rows: rows to take instead.
    Raises InputError if a packet or a cell cannot have them.
    """
    rows = [1 << k for k in range(packet_width.bit_length()) if split.cell_height % (1 << k) == 0]
    fitting = {y: (packet_width // y, y) for y in rows}
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
