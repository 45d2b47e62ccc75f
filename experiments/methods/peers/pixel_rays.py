"""Rays of pixels as other people's tracers get them: their directions in the world, and their order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.ray_space import from_eye_space
from atra.geometry.view import View
from atra.tracing.rays import image_ray_grid

BLOCK = 8
"""Pixels along the sides of the blocks in which peers get rays."""


def block_order(width: int, height: int) -> NDArray[np.int64]:
    """(H W,) numbers of pixels, counted along rows: block by block, each row by row."""
    y, x = np.divmod(np.arange(height * width), width)
    return np.lexsort((x, y, x // BLOCK, y // BLOCK))


def world_directions(camera: View, offset: tuple[float, float]) -> NDArray[np.float32]:
    """(H W, 3) float32, directions of the rays of `PixelTracer` in the order of the rows, world space; lengths make
    their t the depth."""
    column_rays, row_rays = image_ray_grid(camera, offset)
    # Summed in float32 as the kernels of atra do, so that the rays are the same bit by bit.
    directions = column_rays[:, None, :] + row_rays[:, :, None]
    # A peer sees the mesh in the world's axes; ray space has the camera's where the view is narrow.
    to_ray_space = from_eye_space(camera)
    if not np.array_equal(to_ray_space, np.eye(3)):
        directions = np.tensordot(to_ray_space.T, directions, 1).astype(np.float32)
    return np.ascontiguousarray(directions.reshape(3, -1).T)
