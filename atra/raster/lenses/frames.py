"""A frame through a lens: planes of its tiles turned to the world, clusters in order, tiles drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.target_kernels import band_stride
from atra.compiled.threads import WorkerPool
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.raster.frames import FrameMemory
from atra.raster.image import EYE_NUMBERS, ImageAddresses, least_depth_of
from atra.raster.lenses.culling import balls_of
from atra.raster.lenses.drawing import LensTiles, lens_drawing_kernel
from atra.raster.lenses.planes import LensPlanes, lens_planes
from atra.tracing.lens_rays import lens_directions, rays_key


class LensDrawing:
    """Draws frames through a lens. The planes and directions of the last lens, sensor and offset are kept, whatever its
    pose."""

    def __init__(self) -> None:
        self._kept: tuple[Any, LensPlanes, NDArray[np.float64]] | None = None

    def planes(self, camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> LensPlanes:
        """The planes of a camera."""
        key = rays_key(camera, offset)
        if self._kept is None or self._kept[0] != key:
            directions = lens_directions(camera, offset, pool)
            self._kept = key, lens_planes(directions, camera.pixel_pitch, pool), directions
        return self._kept[1]

    @property
    def bytes(self) -> int:
        """Memory of the planes that are kept."""
        return 0 if self._kept is None else self._kept[1].bytes

    def draw(
        self,
        mesh: Mesh,
        camera: LensView,
        offset: tuple[float, float],
        lanes: int,
        memory: FrameMemory,
        pool: WorkerPool,
        out: tuple[NDArray[np.float32], NDArray[np.uint32]],
    ) -> None:
        """Write depth and prim_id of all pixels to `out`, two arrays (H, W)."""
        mesh, camera = own_space(mesh, camera)
        planes, (depth, prim_id) = self.planes(camera, offset, pool), out
        side, clusters = planes.side, memory.clusters
        turned = planes.forms @ camera.axes
        eyes = np.zeros((len(turned), EYE_NUMBERS))
        eyes[:, :3], eyes[:, 3:15].reshape(-1, 3, 4)[:, :, :3], eyes[:, 15:] = camera.eye, turned, turned[:, 2]
        cones = np.column_stack([planes.cones[:, :3] @ camera.axes, planes.cones[:, 3:]])
        balls, order = balls_of(clusters.boxes, np.array(camera.eye))
        tiles = LensTiles(
            side, planes.columns, eyes.ctypes.data, least_depth_of(mesh, eyes[0, :3]), planes.places.ctypes.data
        )
        image = ImageAddresses(depth.ctypes.data, prim_id.ctypes.data, camera.width, camera.height)
        threads = memory.of_threads(pool.threads, side, side, 8 * side * int(band_stride.py_func(side)))
        rest = tiles, cones, planes.margins, balls, order, clusters.boxes, clusters.addresses, image
        kernel: Any = lens_drawing_kernel(lanes)
        pool.run(lambda worker, counter: kernel(counter, *rest, threads[worker]))
