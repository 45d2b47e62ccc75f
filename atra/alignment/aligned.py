"""The paper's method: trace the reference cell's rays through the geometry of all cells, sheared onto them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.culling import plan_aligned_geometry
from atra.alignment.instancing import check_instancing_budget, plan_instanced_geometry
from atra.alignment.options import AlignedKeywords, AlignedOptions, FramesKeywords, FramesOptions
from atra.alignment.reference_rays import ReferenceRayTracer, reference_rays
from atra.alignment.second_pass import SecondPass, with_neighbours
from atra.alignment.visibility import Tiles, nearest_in_tiles
from atra.embree.callbacks_kernels import nearest_hit_filter
from atra.embree.device import EmbreeDevice
from atra.embree.packets_kernels import PixelTiles
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.hits import Frames, Hits
from atra.packets.all_hits import EmbreeGathering, Shots
from atra.packets.pixel import image_shots
from atra.tracing.base import ImageTracer
from atra.tracing.budgets import check_memory_budget
from atra.tracing.geometry import AlignedGeometry, LeftOut, plan_plain_geometry
from atra.tracing.images import images_of
from atra.tracing.lifetime import Result, check_same_faces, in_turn
from atra.tracing.options import lists_options
from atra.tracing.rays import SQUAREST_SHAPE, longest_ray

if TYPE_CHECKING:  # loaded by the first `gather`, which nearest hits do without
    from atra.raster.all_hits.doubts_kernels import Precision

SECOND_PASS_TILE = (8, 4)
"""Tile size of the second pass, (width, height) in pixels: whole packets of any shape."""


class _AlignedImages(ReferenceRayTracer[Result]):
    """Traces all images of an alignment at once; the base of `AlignedTracer` and `FramesTracer`."""

    options_type: ClassVar[type[FramesOptions]] = FramesOptions
    options: FramesOptions

    def __init__(self, meshes: Mesh | Sequence[Mesh], alignment: Alignment, options: Mapping[str, Any]) -> None:
        count = alignment.image_count
        self.meshes = _one_for_each(meshes, count)
        super().__init__(options)
        self._check_meshes(self.meshes)
        self._align(self.meshes, alignment)
        self._second_passes: list[SecondPass | None] = []  # one per image, None if nothing was left out
        cells = self.split.cell_count * count
        if self.options.geometry == "instanced":
            check_instancing_budget(self.mesh, cells, self.options)
        elif not self.options.culling:
            copies = sum(mesh.triangle_count for mesh in self.meshes) * self.split.cell_count
            check_memory_budget(copies, cells, self.options)

    def _check_meshes(self, meshes: tuple[Mesh, ...]) -> None:
        if self.options.geometry == "instanced" and any(mesh is not meshes[0] for mesh in meshes):
            raise InputError(
                "geometry is 'instanced' and the frames have meshes of their own, but instances show one mesh; "
                "use geometry='copied'"
            )

    def _plan_geometry(self) -> AlignedGeometry:
        if self.options.geometry == "instanced":
            return plan_instanced_geometry(self.mesh, self.alignment, self.options, self._row_stride, self._pool)
        return plan_aligned_geometry(self.meshes, self.alignment, self.options, self._row_stride, self._pool)

    def _filter_address(self) -> int:
        return nearest_hit_filter(*self.packet_shape, self.options.geometry == "instanced")

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeDevice:
        self._close_second_passes()
        self._second_passes = [
            None if left_out is None else self._second_pass(mesh, camera, left_out)
            for (mesh, camera), left_out in zip(self.views, geometry.left_out, strict=False)
        ]
        return super()._build_scene(geometry)

    def _second_pass(self, mesh: Mesh, camera: View, left_out: LeftOut) -> SecondPass:
        if self.options.robust:
            shown = with_neighbours(mesh, left_out.prim_ids)
        else:
            shown = np.zeros(mesh.triangle_count, np.bool_)
            shown[left_out.prim_ids] = True
        plain = plan_plain_geometry(mesh, camera, ~shown)
        tiles = Tiles(*SECOND_PASS_TILE, camera.width, camera.height)
        nearest = nearest_in_tiles(mesh, camera, tiles, left_out)
        scene = self._scene_of(plain, self.options.build_quality)
        return SecondPass(scene, camera, tiles, nearest)

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        self._trace_reference_rays(offset, depth, prim_id)
        height = self.camera.height
        for image, second_pass in enumerate(self._second_passes):
            if second_pass is not None:
                rows = slice(image * height, (image + 1) * height)
                second_pass.trace(self._pool, self._workspaces, self.packet_width, offset, depth[rows], prim_id[rows])

    @property
    @in_turn
    def counters(self) -> Mapping[str, float]:
        """As `atra.Tracer` says; triangles_left_out and packets_verified are known as well."""
        left_out = () if self.geometry is None else self.geometry.left_out
        second_passes = [one for one in self._second_passes if one is not None]
        return {
            **super().counters,
            "triangles_left_out": sum(len(one.prim_ids) for one in left_out if one is not None),
            "packets_verified": sum(one.packets_traced for one in second_passes),
        }

    @property
    @in_turn
    def embree_bytes(self) -> int:
        """Bytes that Embree reports for all scenes; 0 before `build`."""
        return super().embree_bytes + sum(one.scene.embree_bytes for one in self._second_passes if one is not None)

    def _close_second_passes(self) -> None:
        for second_pass in self._second_passes:
            if second_pass is not None:
                second_pass.close()
        self._second_passes = []

    def _forget(self) -> None:
        super()._forget()
        self._close_second_passes()


class AlignedTracer(EmbreeGathering, _AlignedImages[Hits], ImageTracer):
    """Affine-transformed ray alignment: trace the reference cell's rays and get the nearest hit of every cell.

    split: (nx, ny) cells; nx must divide the width, ny the height. options: see `atra.AlignedOptions`. With instances,
    `triangle_count` is the mesh's own. Raises InputError for a split that does not divide the image, and as the options
    do; MemoryBudgetError before allocating. Source: paper §3.1, §3.4; instances §4.4.
    """

    options_type = AlignedOptions
    options: AlignedOptions

    @lists_options(AlignedOptions)
    def __init__(self, mesh: Mesh, camera: View, split: tuple[int, int], **options: Unpack[AlignedKeywords]) -> None:
        reference = options.get("reference", AlignedOptions.reference)
        super().__init__((mesh,), Alignment.of_cells(camera, Split.of_image(split, camera), reference), options)

    def _show(self, mesh: Mesh, camera: View) -> None:
        self._align((mesh,), Alignment.of_cells(camera, self.split.of(camera), self.options.reference))
        self.meshes = (mesh,)

    @property
    def _gathering_row(self) -> int:
        return self._row_stride  # of the records

    def _planned_shots(self) -> list[Shots]:
        geometry, split = self.geometry, self.split
        assert geometry is not None
        strips = np.zeros((split.cell_height // self.packet_shape[1], 2), np.int32)
        strips[:, 1] = np.arange(0, split.cell_height, self.packet_shape[1])
        tiles = PixelTiles(strips, split.cell_width, self.packet_shape[1])
        cell = split.cell_width, split.cell_height
        rays = partial(reference_rays, self.alignment)  # no method: it would keep a reference to this tracer
        shots = [Shots(geometry, self.options.geometry, self.packet_shape, rays, tiles, cell)]
        for left_out in geometry.left_out:
            if left_out is not None:
                shots.append(self._shots_at(left_out))
        return shots

    def _shots_at(self, left_out: LeftOut) -> Shots:
        """The rays of the second pass, in the tiles where triangles were left out."""
        mesh, camera, shape = self.mesh, self.camera, SQUAREST_SHAPE[self.packet_width]
        tiles = Tiles(*SECOND_PASS_TILE, camera.width, camera.height)
        rows, columns = np.nonzero(np.isfinite(nearest_in_tiles(mesh, camera, tiles, left_out)))
        corners = np.stack([columns * tiles.tile_width, rows * tiles.tile_height], axis=1).astype(np.int32)
        others = np.ones(mesh.triangle_count, np.bool_)
        others[left_out.prim_ids] = False
        plain = plan_plain_geometry(mesh, camera, others)
        image_tiles = PixelTiles(corners, tiles.tile_width, tiles.tile_height)
        return image_shots(plain, camera, shape, image_tiles, is_alone=camera.width % shape[0] != 0)

    def _precision(self) -> Precision:
        from atra.raster.all_hits.doubts_kernels import Precision

        direction, origin = longest_ray(self.camera)
        shift = sum(float(np.linalg.norm(shears, axis=1).max()) for shears in self.alignment.shears)
        stretch, shift = (1.0, origin + shift) if self.camera.is_parallel else (1.0 + shift, 0.0)
        return Precision.of(self.camera.pixel_pitch, direction, stretch, shift, self.options.robust)


class FramesTracer(_AlignedImages[Frames]):
    """Several images from one set of rays: two eyes, or frames of a moving camera, each with its own cells.

    meshes: one for all frames, or one per frame, so geometry may move. alignment: `Alignment.of_eyes`,
    `Alignment.of_frames`, or any other. options: see `atra.FramesOptions`; instances need one mesh for all frames.
    `look` takes another alignment of as many frames, `update` other vertices of the same faces. Raises InputError
    unless there is one mesh or one per frame, and as `AlignedTracer` does. Source: paper §6, Fig. 8.
    """

    @lists_options(FramesOptions)
    def __init__(self, meshes: Mesh | Sequence[Mesh], alignment: Alignment, **options: Unpack[FramesKeywords]) -> None:
        super().__init__(meshes, alignment, options)

    def _show(self, mesh: Mesh, camera: View) -> None:
        raise NotImplementedError("frames have several cameras")

    def look(self, alignment: Alignment) -> None:  # type: ignore[override]
        """Trace what the cameras of `alignment` see from the next call on: as many frames as before.

        Raises InputError for anything but an alignment of as many frames, else as `AlignedTracer.look`.
        """
        with self._lock:
            self._check_open()
            count = len(self.meshes)
            if not isinstance(alignment, Alignment) or alignment.image_count != count:
                raise InputError(
                    f"FramesTracer shows {count} cameras at once and cannot look through {alignment!r:.100}; expected "
                    f"an Alignment of {count} frames, such as Alignment.of_frames makes"
                )
            self._align(self.meshes, alignment)
            self._build_again()

    def update(self, meshes: Mesh | Sequence[Mesh]) -> None:
        """Trace other vertices of the same faces from the next call on. meshes: one for all frames, or one per frame.

        Raises InputError for other faces and another number of meshes, else as `AlignedTracer.update`.
        """
        with self._lock:
            self._check_open()
            others = _one_for_each(meshes, len(self.meshes))
            for before, mesh in zip(self.meshes, others, strict=True):
                check_same_faces(before, mesh)
            self._check_meshes(others)
            self._align(others, self.alignment)
            self.meshes = others
            self._build_again()

    def _trace(self, offset: tuple[float, float], out: Frames | None) -> Frames:
        cameras, height, width = self.alignment.cameras, self.camera.height, self.camera.width
        rows = len(cameras) * height
        images = images_of(out)
        stacked = None if images is None else (_stacked(images[0]), _stacked(images[1]))
        depth, prim_id = self._trace_rows(offset, rows, stacked)
        shape = (len(cameras), height, width)
        depth, prim_id = _unstacked(depth, shape), _unstacked(prim_id, shape)
        return Frames(depth, prim_id, offset, self.meshes, cameras, self.threads)


def _one_for_each(meshes: Mesh | Sequence[Mesh], count: int) -> tuple[Mesh, ...]:
    """A mesh for each of `count` frames. Raises InputError unless one is given, or one per frame."""
    given = (meshes,) * count if isinstance(meshes, Mesh) else tuple(meshes)
    if len(given) != count:
        raise InputError(f"{len(given)} meshes for {count} frames; expected one for each, or one for all")
    return given


def _unstacked(images: NDArray, shape: tuple[int, int, int]) -> NDArray:
    """View (K H, W) images, one below the other, as (K, H, W)."""
    row_bytes, pixel_bytes = images.strides
    return np.lib.stride_tricks.as_strided(images, shape, (shape[1] * row_bytes, row_bytes, pixel_bytes))


def _stacked(images: NDArray) -> NDArray:
    """The reverse of `_unstacked`. Arrays of other origin get strides that are refused later."""
    if images.ndim != 3:
        raise InputError(f"out has images of {images.shape}, expected (frames, height, width) of an earlier result")
    count, height, width = images.shape
    image_bytes, row_bytes, pixel_bytes = images.strides
    if image_bytes != height * row_bytes:
        raise InputError("out has images that do not follow each other in memory: pass a result of this tracer")
    return np.lib.stride_tricks.as_strided(images, (count * height, width), (row_bytes, pixel_bytes))
