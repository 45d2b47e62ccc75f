"""The rays of a camera with a lens as kernels take them: a table of directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.lenses.lens_kernels import fill_table
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.ray_space import ray_axes


class LensRays:
    """The table of a camera and an offset; the last one is kept."""

    def __init__(self) -> None:
        self._kept: tuple[LensView, tuple[float, float], NDArray[np.float32]] | None = None

    def table(self, camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float32]:
        """(3, H, W) float32, directions in ray space; NaN for pixels without a ray."""
        if self._kept is None or self._kept[:2] != (camera, offset):
            columns, rows = camera.sensor_coordinates(np.arange(camera.width), np.arange(camera.height), offset)
            table, numbers = np.empty((3, camera.height, camera.width), np.float32), camera.lens.numbers
            turn = np.ascontiguousarray(ray_axes(camera).T)
            pool.run(lambda _, counter: fill_table(counter, numbers, columns, rows, turn, table))
            self._kept = camera, offset, table
        return self._kept[2]
