"""The paper's method: trace the reference cell's rays through the geometry of all cells, sheared onto them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

from atra.alignment.alignment import REFERENCES, Alignment
from atra.alignment.cells import CellOptions, check_aligned
from atra.alignment.copies import copied_geometry, instanced_geometry
from atra.alignment.prepared import PreparedCells
from atra.alignment.second_pass import left_out_pass
from atra.choices import check_choice
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.packets.all_hits import check_gathering
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
        check_aligned((mesh,), self.alignment(camera), self.options)

    def check_gathering(self, camera: View) -> None:
        """See `Method.check_gathering`."""
        check_gathering(camera, self.options.build_quality)

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedCells:
        """Cull, shear and build."""
        return prepare_aligned((mesh,), self.alignment(camera), self.options, pool)


def prepare_aligned(
    meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions, pool: WorkerPool
) -> PreparedCells:
    """Cull, shear and build for the images of an alignment. meshes: one per image; with instances all are one mesh."""
    prepared = PreparedCells(meshes, alignment, options, pool)
    start = perf_counter()
    if options.is_instanced:
        geometry = instanced_geometry(meshes[0], alignment, options, prepared.row_stride, pool)
    else:
        geometry = copied_geometry(meshes, alignment, options, prepared.row_stride, pool)
    ready = perf_counter()
    prepared.second_passes = [
        left_out_pass(*seen, options, pool) for seen in zip(meshes, alignment.cameras, geometry.left_out, strict=True)
    ]
    prepared.build(geometry)
    prepared.plan_time_s, prepared.build_time_s = ready - start, perf_counter() - ready
    prepared.told["triangles_left_out"] = sum(
        len(triangles.prim_ids) for triangles in geometry.left_out if triangles is not None
    )
    return prepared


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

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> with atra.AlignedTracer(mesh, camera, split=(4, 1)) as tracer:
    ...     hits = tracer.trace()
    >>> print(atra.compare(hits, atra.trace(mesh, camera)))
    3072 of 3072 pixels equal, 0 tied, 0 edge, 0 wrong
    """
    options = CellOptions(
        packet_width=packet_width, packet_rows=packet_rows, build_quality=build_quality, robust=robust,
        memory_budget_bytes=memory_budget_bytes, geometry=geometry, culling=culling,
    )  # fmt: skip
    return Tracer(mesh, camera, Aligned(split, reference, options), threads=threads, ties=ties)
