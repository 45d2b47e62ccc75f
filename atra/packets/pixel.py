"""One ray per pixel: the paper's baseline with single rays, and the stronger one with packets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import NDArray

from atra.embree.device import EmbreeDevice
from atra.embree.packets_kernels import Image, PixelTiles, RayGrid
from atra.embree.scene import EmbreeScene
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import from_eye_space
from atra.geometry.view import View
from atra.packets.all_hits import EmbreeGathering, Shots
from atra.packets.lens_kernels import lens_kernel
from atra.packets.pixel_kernels import pixel_kernel
from atra.tracing.base import ImageTracer, check_views
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from atra.tracing.lens_rays import LensRays
from atra.tracing.options import PixelKeywords, PixelOptions, lists_options
from atra.tracing.rays import SQUAREST_SHAPE, image_ray_grid, longest_ray, pixel_tiles

if TYPE_CHECKING:  # loaded by the first `gather`, which nearest hits do without
    from atra.raster.all_hits.doubts_kernels import Precision


class PixelTracer(EmbreeGathering, ImageTracer):
    """One ray per pixel, by `rtcIntersect1` (packet_width 1, the paper's baseline) or packets (4, 8, 16).

    options: see `atra.PixelOptions`. `look` keeps the BVH while the eye stays in place: turning and zooming are free.
    Rays start at the origin of Embree's space, so another eye needs another BVH (docs/methods.md says why). Raises
    InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the eye, where float32
    would lose triangles; MemoryBudgetError, when planning, for more overlaps than can be kept.
    """

    options_type = PixelOptions
    options: PixelOptions

    @lists_options(PixelOptions)
    def __init__(self, mesh: Mesh, camera: View, **options: Unpack[PixelKeywords]) -> None:
        super().__init__(options)
        rows = self.options.packet_rows
        self.packet_shape = SQUAREST_SHAPE[self.packet_width] if rows is None else (self.packet_width // rows, rows)
        self._lens_rays = LensRays()
        self._show(mesh, camera)

    def _show(self, mesh: Mesh, camera: View) -> None:
        views = ((mesh, camera),)
        check_views(views, takes_lenses=True)
        self._show_views(views)
        self._tiles = pixel_tiles(camera.width, camera.height, self.options.tile_order)
        for workspace in self._workspaces:
            workspace.set_coherent(self.options.coherent)

    def _look(self, camera: View) -> bool:
        """Keep the BVH for a camera that turns about its eye: it has the same ray space."""
        before = self.camera
        if camera.eye != before.eye or not np.array_equal(from_eye_space(camera), from_eye_space(before)):
            return super()._look(camera)
        self._show(self.mesh, camera)
        if self._is_built:
            self._plan_ties()
        return True

    def _plan_geometry(self) -> AlignedGeometry:
        return plan_plain_geometry(self.mesh, self.camera)

    def _filter_address(self) -> int:
        return 0

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeDevice:
        return self._scene_of(geometry, self.options.build_quality, compact=self.options.compact)

    def _gathering_scene(self, geometry: AlignedGeometry) -> EmbreeScene:
        flags = {"compact": self.options.compact, "filter_in_arguments": True}
        return self._scene_of(geometry, self.options.build_quality, **flags)

    def _planned_shots(self) -> list[Shots]:
        assert self.geometry is not None
        return [image_shots(self.geometry, self.camera, self.packet_shape, self._tiles)]

    def _precision(self) -> Precision:
        from atra.raster.all_hits.doubts_kernels import Precision

        direction, origin = longest_ray(self.camera)
        return Precision.of(self.camera.pixel_pitch, direction, 1.0, origin, self.options.robust)

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        camera, tiles, scene = self.camera, self._tiles, self._scene_address
        if isinstance(camera, LensView):
            self._run_lens(camera, offset, Image(depth, prim_id))
            return
        rays, image = RayGrid(*image_ray_grid(camera, offset, self.packet_shape)), Image(depth, prim_id)
        kernel = pixel_kernel(*self.packet_shape, camera.is_parallel)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, rays, tiles, image)

        self._pool.run(work)

    def _directions(self, camera: View, offset: tuple[float, float]) -> NDArray[np.float64] | None:
        if isinstance(camera, LensView):
            return self._lens_rays.directions(camera, offset, self._pool)
        return super()._directions(camera, offset)

    def _run_lens(self, camera: LensView, offset: tuple[float, float], image: Image) -> None:
        table, tiles, scene = self._lens_rays.table(camera, offset, self._pool), self._tiles, self._scene_address
        kernel = lens_kernel(*self.packet_shape)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, table, tiles, image)

        self._pool.run(work)


def image_shots(
    geometry: AlignedGeometry, camera: View, packet_shape: tuple[int, int], tiles: PixelTiles, is_alone: bool = False
) -> Shots:
    """One ray per pixel of an image, through the mesh in the camera's ray space."""

    def rays(offset: tuple[float, float]) -> RayGrid:
        return RayGrid(*image_ray_grid(camera, offset, packet_shape))

    return Shots(geometry, "none", packet_shape, rays, tiles, (camera.width, camera.height), is_alone)
