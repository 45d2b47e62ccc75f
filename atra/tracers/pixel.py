"""One ray per pixel: the paper's baseline, and the expert's in packets."""

from __future__ import annotations

from numpy.typing import NDArray

from atra.alignment.culling import AlignedGeometry, plan_plain_geometry
from atra.kernels.packets import Image, RayGrid
from atra.kernels.tracing import pixel_kernel
from atra.tracers.base import ImageTracer
from atra.tracers.rays import image_ray_grid

SQUAREST_SHAPE = {1: (1, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4)}
"""Pixels of a packet when nothing else decides: the narrower the bundle, the more of the traversal its rays share."""


class PixelTracer(ImageTracer):
    """One ray per pixel through `rtcIntersect1` (packet_width 1, the paper's baseline) or packets (4, 8, 16).

    PixelTracer(mesh, camera, options=None, **changes): options are of `atra.Options`, changes fields of it by name.
    Raises InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the eye, where
    float32 would lose triangles; MemoryBudgetError, when planning, for more overlaps than can be kept.
    """

    def _plan_geometry(self) -> AlignedGeometry:
        return plan_plain_geometry(self.mesh, self.camera)

    def _filter_address(self) -> int:
        return 0

    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None:
        shape = SQUAREST_SHAPE[self.packet_width]
        camera = self.camera
        rays, image = RayGrid(*image_ray_grid(camera, offset, shape)), Image(depth, prim_id)
        kernel = pixel_kernel(*shape, camera.is_parallel)

        scene = self._scene_address

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, self._workspaces[worker].packet, rays, image)

        self._pool.run(work)
