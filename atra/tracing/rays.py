"""Rays of an image as kernels take them: a summand for every column of pixels and one for every row, in float32; and
the tiles of the image in whose order they are traced."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.embree.packets_kernels import PixelTiles, RayGrid
from atra.errors import InputError
from atra.geometry.ray_space import ray_axes
from atra.geometry.view import View

SQUAREST_SHAPE = {1: (1, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4)}
"""Pixels of a packet when nothing else decides: the narrower the bundle, the more of the traversal its rays share."""

_WIDEST_PACKET = 16

TILE_ORDERS = ("blocks", "rows", "morton")
"""Orders of an image's tiles: blocks row by row, rows as wide as the image, or blocks along a Morton curve."""

_TILE_SIZES = {"blocks": (32, 16), "morton": (16, 16)}
"""Width and height; tiles of rows are as wide as the image."""


def ray_grid(camera: View, columns: NDArray[np.floating], rows: NDArray[np.floating]) -> RayGrid:
    """The two summands of ray directions in ray space, or of origins where rays are parallel.

    columns, rows: positions on the image plane in pixels, measured from the view axis.
    """
    right, down, forward = ray_axes(camera)[:, :, None]
    column_rays = right * (columns * camera.plane.pitch_x)
    row_rays = down * (rows * camera.plane.pitch_y)
    if not camera.is_parallel:
        row_rays = row_rays + forward
    return RayGrid(column_rays.astype(np.float32), row_rays.astype(np.float32))


def image_ray_grid(camera: View, offset: tuple[float, float], packet_shape: tuple[int, int] = (1, 1)) -> RayGrid:
    """`ray_grid` of every pixel of the image at sub-pixel `offset`, filled up to whole packets of `packet_shape`."""
    x, y = (
        np.arange(pixels + -pixels % lanes)
        for pixels, lanes in zip((camera.width, camera.height), packet_shape, strict=True)
    )
    return ray_grid(camera, camera.plane.columns(x, offset[0]), camera.plane.rows(y, offset[1]))


def longest_ray(camera: View) -> tuple[float, float]:
    """Lengths of the longest direction, per depth, and of the way from the eye to the farthest origin."""
    corner = float(np.hypot(camera.width, camera.height)) / 2 * camera.pixel_pitch
    return (1.0, corner) if camera.is_parallel else (float(np.hypot(1.0, corner)), 0.0)


def check_pinhole(camera: View, method: str) -> None:
    """Raise InputError for a camera with parallel rays, which `method` cannot trace."""
    if camera.is_parallel:
        raise InputError(
            f"{method} needs rays through one point, but those of {type(camera).__name__} are parallel; "
            "use AlignedTracer or PixelTracer"
        )


def pixel_tiles(width: int, height: int, order: str = "blocks") -> PixelTiles:
    """An image in tiles, in one of `TILE_ORDERS`: small enough to share out evenly, large enough to stay in cache."""
    tile_width, tile_height = _TILE_SIZES.get(order, (width + -width % _WIDEST_PACKET, _WIDEST_PACKET))
    rows, columns = np.mgrid[0:height:tile_height, 0:width:tile_width]
    corners = np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.int32)
    if order == "morton":
        corners = corners[np.argsort(_along_curve(corners // (tile_width, tile_height)))]
    return PixelTiles(corners, tile_width, tile_height)


def _along_curve(places: NDArray[np.integer]) -> NDArray[np.int64]:
    """(N, 2) columns and rows -> their bits in turn: the order of a Morton curve."""
    curve = np.zeros(len(places), np.int64)
    for bit in range(int(places.max()).bit_length()):
        for axis in (0, 1):
            curve |= (places[:, axis].astype(np.int64) >> bit & 1) << 2 * bit + axis
    return curve
