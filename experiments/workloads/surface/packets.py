"""Packets per pixel that keep what Embree says of the place of each hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.embree.packets_kernels import Image, RayGrid
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.packets.pixel import PixelTracer
from atra.packets.pixel_kernels import Surface, surface_kernel
from atra.tracing.rays import image_ray_grid


class SurfacePackets(PixelTracer):
    """surface: of the last frame; what stands where nothing is hit has no meaning. Ties are settled in `prim_id` alone:
    where triangles tie, it may be that of another than is stored."""

    def _show(self, mesh: Mesh, camera: View) -> None:
        super()._show(mesh, camera)
        size = camera.height, camera.width
        self.surface = Surface(np.empty(size, np.float32), np.empty(size, np.float32), np.empty((*size, 3), np.float32))

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        tiles, scene, surface = self._tiles, self._scene_address, self.surface
        rays, image = RayGrid(*image_ray_grid(self.camera, offset, self.packet_shape)), Image(depth, prim_id)
        kernel = surface_kernel(*self.packet_shape)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, rays, tiles, image, surface)

        self._pool.run(work)
