"""The rays of a camera with a lens as kernels take them: tables of directions."""

from __future__ import annotations

from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.lenses.lens_kernels import fill_directions, turn_directions
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.ray_space import ray_axes

_in_use: WeakValueDictionary[Any, NDArray[np.float64]] = WeakValueDictionary()
"""Directions that some object keeps, which are not computed again."""


def lens_directions(camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float64]:
    """(3, H, W) float64, directions in camera space; NaN for pixels without a ray."""
    key = rays_key(camera, offset)
    directions = _in_use.get(key)
    if directions is None:
        columns, rows = camera.sensor_coordinates(np.arange(camera.width), np.arange(camera.height), offset)
        filled, numbers = np.empty((3, camera.height, camera.width)), camera.lens.numbers
        pool.run(lambda _, counter: fill_directions(counter, numbers, columns, rows, filled))
        directions = _in_use[key] = filled
    return directions


def world_directions(camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float32]:
    """(3, H, W) float32, directions in world space; NaN for pixels without a ray."""
    directions, turn = lens_directions(camera, offset, pool), np.ascontiguousarray(camera.axes.T)
    table = np.empty(directions.shape, np.float32)
    pool.run(lambda _, counter: turn_directions(counter, directions, turn, table))
    return table


def rays_key(camera: LensView, offset: tuple[float, float]) -> Any:
    """What the directions of a camera and an offset depend on: not on its pose."""
    return camera.lens, camera.sensor, camera.width, camera.height, offset


class LensRays:
    """The table of a camera and an offset. The last one is kept; another pose turns the same directions."""

    def __init__(self) -> None:
        self._directions = np.empty((3, 0, 0))  # as long as they are kept, `lens_directions` finds them
        self._table: tuple[tuple[LensView, tuple[float, float]], NDArray[np.float32]] | None = None

    def table(self, camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float32]:
        """(3, H, W) float32, directions in ray space; NaN for pixels without a ray."""
        if self._table is None or self._table[0] != (camera, offset):
            directions = self._directions = lens_directions(camera, offset, pool)
            table, turn = np.empty(directions.shape, np.float32), np.ascontiguousarray(ray_axes(camera).T)
            pool.run(lambda _, counter: turn_directions(counter, directions, turn, table))
            self._table = (camera, offset), table
        return self._table[1]
