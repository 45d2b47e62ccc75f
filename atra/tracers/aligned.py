"""The paper's method: the reference cell's rays against the geometry of all cells, sheared onto them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.culling import (
    AlignedGeometry,
    LeftOut,
    check_memory_budget,
    plan_aligned_geometry,
    plan_plain_geometry,
)
from atra.alignment.instancing import check_instancing_budget, plan_instanced_geometry
from atra.alignment.split import Split
from atra.alignment.visibility import Tiles, nearest_in_tiles
from atra.embree.device import EmbreeDevice
from atra.embree.scene import EmbreeScene
from atra.errors import InputError
from atra.frames import Frames
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.kernels.callbacks import memory_monitor, nearest_hit_filter
from atra.tracers.base import ImageTracer, images_of, one_at_a_time
from atra.tracers.reference_rays import ReferenceRayTracer
from atra.tracers.second_pass import SecondPass

GEOMETRIES = ("copied", "instanced")
"""How the cells' sheared geometry comes into the scene."""

SECOND_PASS_TILE = (8, 4)
"""Width and height in pixels of the tiles of the second pass: whole packets of any shape."""


class _AlignedImages(ReferenceRayTracer):
    """All images of an alignment at once; `AlignedTracer` and `FramesTracer` are its two faces."""

    def __init__(
        self,
        meshes: Mesh | Sequence[Mesh],
        alignment: Alignment,
        culling: bool = True,
        geometry: str = "copied",
        packet_width: int | None = None,
        threads: int | None = None,
        build_quality: str = "medium",
        memory_budget_bytes: int | None = None,
        packet_rows: int | None = None,
        ties: str = "lowest",
    ) -> None:
        count = alignment.image_count
        self.meshes = (meshes,) * count if isinstance(meshes, Mesh) else tuple(meshes)
        if len(self.meshes) != count:
            raise InputError(f"{len(self.meshes)} meshes for {count} frames; expected one for each, or one for all")
        _check_geometry(geometry, culling, self.meshes)
        self.culling = culling
        self.geometry = geometry
        self.memory_budget_bytes = memory_budget_bytes
        first = self.meshes[0]
        super().__init__(first, alignment, packet_width, packet_rows, threads, build_quality, ties)
        self._second_passes: list[SecondPass | None] = []  # of each image that copies cannot show all of
        cells = self.split.cell_count
        if geometry == "instanced":
            check_instancing_budget(first, cells * count, build_quality, memory_budget_bytes)
        elif not culling:
            copies = sum(mesh.triangle_count for mesh in self.meshes) * cells
            check_memory_budget(copies, build_quality, memory_budget_bytes, cells * count)

    def _plan_geometry(self) -> AlignedGeometry:
        if self.geometry == "instanced":
            return plan_instanced_geometry(
                self.mesh,
                self.alignment,
                row_stride=self._row_stride,
                pool=self._pool,
                memory_budget_bytes=self.memory_budget_bytes,
                build_quality=self.build_quality,
            )
        return plan_aligned_geometry(
            self.meshes,
            self.alignment,
            culling=self.culling,
            row_stride=self._row_stride,
            pool=self._pool,
            memory_budget_bytes=self.memory_budget_bytes,
            build_quality=self.build_quality,
        )

    @property
    def _views(self) -> tuple[tuple[Mesh, View], ...]:
        return tuple(zip(self.meshes, self.alignment.cameras, strict=True))

    def _filter_address(self) -> int:
        return nearest_hit_filter(*self.packet_shape, self.geometry == "instanced")

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeDevice:
        self._close_second_passes()
        self._second_passes = [
            None if left_out is None else self._second_pass(mesh, camera, left_out)
            for (mesh, camera), left_out in zip(self._views, geometry.left_out, strict=False)
        ]
        return super()._build_scene(geometry)

    def _second_pass(self, mesh: Mesh, camera: View, left_out: LeftOut) -> SecondPass:
        others = np.ones(mesh.triangle_count, np.bool_)
        others[left_out.prim_ids] = False
        plain = plan_plain_geometry(mesh, camera, others)
        tiles = Tiles(*SECOND_PASS_TILE, camera.width, camera.height)
        nearest = nearest_in_tiles(mesh, camera, tiles, left_out)
        scene = EmbreeScene(
            plain.vertices,
            plain.faces,
            build_quality=self.build_quality,
            threads=self.threads,
            monitor_address=memory_monitor(),
        )
        return SecondPass(scene, camera, tiles, nearest)

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        self._trace_reference_rays(offset, depth, prim_id)
        height = self.camera.height
        for image, second_pass in enumerate(self._second_passes):
            if second_pass is not None:
                rows = slice(image * height, (image + 1) * height)
                second_pass.trace(self._pool, self._workspaces, self.packet_width, offset, depth[rows], prim_id[rows])

    @property
    def triangles_left_out(self) -> int:
        """Triangles, over all images, that are traced pixel by pixel because float32 cannot show sheared copies of them
        exactly enough (`atra.alignment.rounding`); 0 before `plan`."""
        left_out = () if self._geometry is None else self._geometry.left_out
        return sum(0 if one is None else len(one.prim_ids) for one in left_out)

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for all scenes by its own account; 0 before `build`."""
        return super().embree_bytes + sum(one.scene.embree_bytes for one in self._second_passes if one is not None)

    def _close_second_passes(self) -> None:
        for second_pass in self._second_passes:
            if second_pass is not None:
                second_pass.close()
        self._second_passes = []

    @one_at_a_time
    def close(self) -> None:
        """Release the Embree scenes and the geometry; waits for a frame in progress. Closing twice is harmless."""
        super().close()
        self._close_second_passes()


class AlignedTracer(_AlignedImages, ImageTracer):
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
        camera: View,
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
        super().__init__(
            (mesh,),
            Alignment.of_cells(camera, Split.of_image(split, camera)),
            culling=culling,
            geometry=geometry,
            packet_width=packet_width,
            threads=threads,
            build_quality=build_quality,
            memory_budget_bytes=memory_budget_bytes,
            packet_rows=packet_rows,
            ties=ties,
        )


class FramesTracer(_AlignedImages):
    """Several images from one set of rays: two eyes, or frames of a moving camera, each with its own cells.

    meshes: one for all frames, or one per frame, so that geometry may move, too. alignment: `Alignment.of_eyes`,
    `Alignment.of_frames`, or any other. Other arguments as for `AlignedTracer`; instances need one mesh for all frames.
    Raises InputError for another number of meshes than frames, and as `AlignedTracer` does.
    Source: paper §6, Fig. 8.
    """

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Frames | None = None) -> Frames:
        """Trace all frames; all rays go through sub-pixel position `offset` of their pixels, in [0, 1) x [0, 1).

        out: an earlier result of this tracer whose arrays are to be overwritten.
        Raises InputError and EmbreeError as `AlignedTracer.trace` does.
        """
        cameras, height, width = self.alignment.cameras, self.camera.height, self.camera.width
        rows = len(cameras) * height
        images = images_of(out)
        stacked = None if images is None else (_stacked(images[0]), _stacked(images[1]))
        depth, prim_id = self._trace_rows(offset, rows, stacked)
        shape = (len(cameras), height, width)
        return Frames(_unstacked(depth, shape), _unstacked(prim_id, shape), offset, self.meshes, cameras)


def _check_geometry(geometry: str, culling: bool, meshes: tuple[Mesh, ...]) -> None:
    if geometry not in GEOMETRIES:
        raise InputError(f"geometry is {geometry!r}, expected one of {', '.join(GEOMETRIES)}")
    if geometry == "instanced" and culling:
        raise InputError(
            "geometry is 'instanced' and culling is on, but an instance is all of the mesh or nothing; "
            "set culling=False"
        )
    if geometry == "instanced" and any(mesh is not meshes[0] for mesh in meshes):
        raise InputError(
            "geometry is 'instanced' and the frames have meshes of their own, but instances show one mesh; "
            "use geometry='copied'"
        )


def _unstacked(images: NDArray, shape: tuple[int, int, int]) -> NDArray:
    """(K H, W), one image below the other -> (K, H, W), the same memory."""
    row_bytes, pixel_bytes = images.strides
    return np.lib.stride_tricks.as_strided(images, shape, (shape[1] * row_bytes, row_bytes, pixel_bytes))


def _stacked(images: NDArray) -> NDArray:
    """The reverse of `_unstacked`; arrays that are not its result come back with strides that do not fit."""
    if images.ndim != 3:
        raise InputError(f"out has images of {images.shape}, expected (frames, height, width) of an earlier result")
    count, height, width = images.shape
    image_bytes, row_bytes, pixel_bytes = images.strides
    if image_bytes != height * row_bytes:
        raise InputError("out has images that do not follow each other in memory: pass a result of this tracer")
    return np.lib.stride_tricks.as_strided(images, (count * height, width), (row_bytes, pixel_bytes))
