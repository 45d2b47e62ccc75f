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
"""Directions that someone keeps, so that nobody computes them again."""


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
    """The tables of a camera and an offset. The last ones are kept; another pose turns the directions of the first."""

    def __init__(self) -> None:
        self._key: Any = None
        self._directions = np.empty((3, 0, 0))
        self._turned: tuple[LensView, NDArray[np.float32]] | None = None

    def directions(self, camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float64]:
        """As `lens_directions`."""
        key = rays_key(camera, offset)
        if self._key != key:
            self._key, self._turned, self._directions = key, None, lens_directions(camera, offset, pool)
        return self._directions

    def table(self, camera: LensView, offset: tuple[float, float], pool: WorkerPool) -> NDArray[np.float32]:
        """(3, H, W) float32, directions in ray space; NaN for pixels without a ray."""
        directions = self.directions(camera, offset, pool)
        if self._turned is None or self._turned[0] != camera:
            table, turn = np.empty(directions.shape, np.float32), np.ascontiguousarray(ray_axes(camera).T)
            pool.run(lambda _, counter: turn_directions(counter, directions, turn, table))
            self._turned = camera, table
        return self._turned[1]
