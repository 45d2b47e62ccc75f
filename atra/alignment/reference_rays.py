"""What tracers with aligned rays share: the cells, the reference rays, and the pass that traces them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.alignment.aligned_kernels import aligned_kernel
from atra.alignment.alignment import Alignment
from atra.alignment.options import ReferenceRayOptions
from atra.embree.packets_kernels import Image, RayGrid
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.tracing.base import EmbreeTracer, check_views
from atra.tracing.budgets import check_image_size
from atra.tracing.lifetime import Result
from atra.tracing.rays import ray_grid, share_direction
from atra.whole_numbers import is_whole_number


class ReferenceRayTracer(EmbreeTracer[Result]):
    """Traces the rays of one reference cell; subclasses decide through which geometry.

    Raises InputError for packet rows that a packet or a cell cannot have.
    """

    options_type: ClassVar[type[ReferenceRayOptions]] = ReferenceRayOptions
    options: ReferenceRayOptions

    def _align(self, meshes: Sequence[Mesh], alignment: Alignment) -> None:
        """Take an alignment and the mesh of each image. Changes nothing if they are refused."""
        split, views = alignment.split, tuple(zip(meshes, alignment.cameras, strict=True))
        check_views(views)
        packet_shape = choose_packet_shape(self.packet_width, split, self.options.packet_rows)
        check_image_size(split.height * alignment.image_count, _row_stride(split, packet_shape))
        self._show_views(views)
        self.alignment, self.split, self.packet_shape = alignment, split, packet_shape

    @property
    def _row_stride(self) -> int:
        return _row_stride(self.split, self.packet_shape)

    def _trace_reference_rays(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        rays = reference_rays(self.alignment, offset)
        cell_rows, image = self.alignment.image_count * self.split.ny, Image(depth, prim_id)
        kernel = aligned_kernel(*self.packet_shape, self.camera.is_parallel)
        scene = self._scene_address
        share_direction(self._workspaces, self.camera)  # a second pass may have set another image's

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, rays, cell_rows, image)

        self._pool.run(work)


def reference_rays(alignment: Alignment, offset: tuple[float, float]) -> RayGrid:
    """The rays that are traced for all cells of an alignment, at a sub-pixel offset."""
    columns = alignment.first_x_pixels + np.arange(alignment.split.cell_width)
    rows = alignment.first_y_pixels + np.arange(alignment.split.cell_height)
    return RayGrid(*ray_grid(alignment.cameras[0], columns + offset[0], rows + offset[1]))


def _row_stride(split: Split, packet_shape: tuple[int, int]) -> int:
    return split.width + -split.cell_width % packet_shape[0]  # plus lanes of the last packet past the image


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
