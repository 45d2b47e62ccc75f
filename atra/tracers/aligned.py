"""The paper's method: the reference cell's rays against the geometry of all cells, sheared onto them."""

from __future__ import annotations

from numpy.typing import NDArray

from atra.camera import Camera
from atra.culling import AlignedGeometry, check_memory_budget, plan_aligned_geometry
from atra.errors import InputError
from atra.instancing import check_instancing_budget, plan_instanced_geometry
from atra.kernels.callbacks import nearest_hit_filter
from atra.mesh import Mesh
from atra.tracers.reference_rays import ReferenceRayTracer

GEOMETRIES = ("copied", "instanced")
"""How the cells' sheared geometry comes into the scene."""


class AlignedTracer(ReferenceRayTracer):
    """Affine-transformed ray alignment: shoot the reference cell's rays, read the nearest hit of every cell.

    split: (nx, ny) cells; nx must divide the width, ny the height. culling: keep of each cell's copy only what its
    frustum meets. geometry: "copied" shears a copy of the triangles for every cell; "instanced" gives the triangles to
    Embree once and an instance of them per cell, with the shear as its transform. An instance is always the whole mesh,
    so it needs `culling=False`, and `triangle_count` is the mesh's own.
    packet_width: 1 is the paper's way, None takes the widest native packets. packet_rows: rows of pixels in a packet,
    so that packets of 8 are 8 x 1, 4 x 2, 2 x 4 or 1 x 8 pixels (None: what suits the cell). memory_budget_bytes:
    refuse plans that need more (None: the memory that is free). Other arguments as for `PixelTracer`.
    Raises InputError for a split that does not divide the image, an unknown geometry, and instances with culling;
    MemoryBudgetError before allocating.
    Source: paper §3.1, §3.4; instances §4.4.
    """

    def __init__(
        self,
        mesh: Mesh,
        camera: Camera,
        split: tuple[int, int],
        culling: bool = True,
        geometry: str = "copied",
        packet_width: int | None = None,
        threads: int | None = None,
        build_quality: str = "medium",
        memory_budget_bytes: int | None = None,
        packet_rows: int | None = None,
        ties: str = "lowest",
    ) -> None:
        if geometry not in GEOMETRIES:
            raise InputError(f"geometry is {geometry!r}, expected one of {', '.join(GEOMETRIES)}")
        if geometry == "instanced" and culling:
            raise InputError(
                "geometry is 'instanced' and culling is on, but an instance is all of the mesh or nothing; "
                "set culling=False"
            )
        self.culling = culling
        self.geometry = geometry
        self.memory_budget_bytes = memory_budget_bytes
        super().__init__(mesh, camera, split, packet_width, packet_rows, threads, build_quality, ties)
        if geometry == "instanced":
            check_instancing_budget(mesh, self.split.cell_count, build_quality, memory_budget_bytes)
        elif not culling:
            copies = mesh.triangle_count * self.split.cell_count
            check_memory_budget(copies, build_quality, memory_budget_bytes, self.split.cell_count)

    def _plan_geometry(self) -> AlignedGeometry:
        if self.geometry == "instanced":
            return plan_instanced_geometry(
                self.mesh,
                self.camera,
                self.alignment,
                row_stride=self._row_stride,
                memory_budget_bytes=self.memory_budget_bytes,
                build_quality=self.build_quality,
            )
        return plan_aligned_geometry(
            self.mesh,
            self.camera,
            self.alignment,
            culling=self.culling,
            row_stride=self._row_stride,
            pool=self._pool,
            memory_budget_bytes=self.memory_budget_bytes,
            build_quality=self.build_quality,
        )

    def _filter_address(self) -> int:
        return nearest_hit_filter(*self.packet_shape, self.geometry == "instanced")

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        self._trace_reference_rays(offset, depth, prim_id)
