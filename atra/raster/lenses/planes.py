"""Planes of a lens: the image cut into tiles, and for each a plane on which its pixels lie almost on a grid.

The rays of a tile pass through its plane in irregular places, and straight edges stay straight there. So triangles are
drawn as those of a pinhole camera are, with samples in their exact places. Nothing is assumed of the lens: how far the
places lie from the grid is computed from all rays of the tile.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.target_kernels import band_stride
from atra.compiled.threads import WorkerPool

LARGEST_SIDE = 128
"""Pixels along the sides of a tile, unless its rays diverge too much for a plane."""

_BENT_SIDE, _BENT_MARGIN = 64, 5.0
"""Pixels along the sides where samples would lie farther from a grid than so many pixels on average."""

_LEAST_COSINE = 0.5
"""Cosine of the largest angle between a ray and the axis of its tile's plane."""

_LEAST_TURN = 0.01
"""Least area of a pixel on the fitted grid, as a share of its squared sides; below, the fit is no grid."""

_LEAST_SPREAD = 1e-9
"""Least determinant of the samples' spread, as a share of its squared size; below, they lie on a line."""

_SLACK = 1e-9
"""Widening of cones, for rounding."""


@dataclass(frozen=True, eq=False)
class LensPlanes:
    """The planes of a camera's T tiles, `columns` in a row, in camera space.

    side: pixels along the sides of a tile. forms: (T, 3, 3) float64, points in camera space to (a, b, c), the position
    (a / c, b / c) on the tile's grid, whose samples are near whole numbers, and the depth c along the tile's axis.
    cones: (T, 5) float64, axis of a cone around all rays of the tile, cosine and sine of its angle. margins: (T,)
    float64, largest distance, along a row or column, of a sample from its whole numbers. places: (T, 3, side, stride)
    float32, for each pixel that distance along the row and the column, and the ray parameter at depth 1; NaN for pixels
    without a ray or outside the image.
    """

    side: int
    columns: int
    forms: NDArray[np.float64]
    cones: NDArray[np.float64]
    margins: NDArray[np.float64]
    places: NDArray[np.float32]

    @property
    def bytes(self) -> int:
        """Memory of the arrays."""
        return self.places.nbytes + self.forms.nbytes + self.cones.nbytes


def lens_planes(directions: NDArray[np.float64], pitch: float, pool: WorkerPool) -> LensPlanes:
    """The planes of an image; they are the same for another pose of the same lens, sensor and size.

    directions: (3, H, W) float64, camera space, NaN for pixels without a ray. pitch: of the camera's pixels.
    """
    side = LARGEST_SIDE
    while True:
        planes = _planes_of(directions, side, pitch, pool)
        is_bent = side > _BENT_SIDE and planes.margins.mean() > _BENT_MARGIN
        if side == 1 or (planes.cones[:, 3].min() >= _LEAST_COSINE and not is_bent):
            return planes
        side //= 2


def _planes_of(directions: NDArray[np.float64], side: int, pitch: float, pool: WorkerPool) -> LensPlanes:
    height, width = directions.shape[1:]
    rows, columns = -(-height // side), -(-width // side)
    tiles, stride = rows * columns, int(band_stride.py_func(side))
    forms, cones, margins = np.empty((tiles, 3, 3)), np.empty((tiles, 5)), np.empty(tiles)
    places = np.full((tiles, 3, side, stride), np.nan, np.float32)
    waiting = iter(range(rows))  # shared by the threads

    def fit_rows(_worker: int, _counter: int) -> None:
        for row in waiting:
            own = directions[:, row * side : (row + 1) * side]
            padded = np.full((side, columns * side, 3), np.nan)
            padded[: own.shape[1], :width] = own.transpose(1, 2, 0)
            tiled = padded.reshape(side, columns, side, 3).transpose(1, 0, 2, 3)
            here = slice(row * columns, (row + 1) * columns)
            forms[here], cones[here] = _fitted(tiled.reshape(columns, side * side, 3), side, pitch)
            margins[here] = _place(tiled, forms[here], places[here, :, :, :side])

    pool.run(fit_rows)
    return LensPlanes(side, columns, forms, cones, margins, places)


def _fitted(
    directions: NDArray[np.float64], side: int, pitch: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Forms and cones of tiles; directions: (T, N, 3), NaN for none."""
    seen = np.asarray(np.isfinite(directions).all(axis=-1))
    unit = np.where(seen[..., None], directions, 0.0)
    unit /= np.maximum(np.linalg.norm(unit, axis=-1, keepdims=True), 1e-300)
    axis = unit.sum(axis=1)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    axis = np.where(length > 1e-6, axis / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    along = np.einsum("tnk,tk->tn", unit, axis)
    cosine = np.clip(np.where(seen, along, 1.0).min(axis=1) - _SLACK, -1.0, 1.0)
    cones = np.column_stack([axis, cosine, np.sqrt(1.0 - cosine**2)])
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    basis = np.stack([across, np.cross(axis, across), axis], axis=1)
    seen &= along > 0.0
    local = np.einsum("tnk,tak->tna", unit, basis[:, :2]) / np.where(seen, along, 1.0)[..., None]
    grid = np.stack(np.divmod(np.arange(side * side), side)[::-1], axis=-1).astype(np.float64)  # column, row
    weight = seen / np.maximum(seen.sum(axis=1), 1)[:, None]
    mean, middle = np.einsum("tn,tna->ta", weight, local), weight @ grid
    centred, wanted = local - mean[:, None], grid - middle[:, None]
    spread = np.einsum("tn,tna,tnb->tab", weight, centred, centred)
    both = np.einsum("tn,tna,tnb->tab", weight, wanted, centred)
    radius = np.sqrt(np.where(seen, (centred**2).sum(axis=-1), 0.0).max(axis=1))
    scale = np.where(radius > 0.0, side / (2.0 * np.maximum(radius, 1e-300)), 1.0 / pitch)
    linear = scale[:, None, None] * np.eye(2)  # where no grid fits, any scale is right
    sizes = spread.trace(axis1=1, axis2=2)
    fits = (np.linalg.det(spread) > _LEAST_SPREAD * sizes**2) & (sizes > 0.0)
    fitted = both[fits] @ np.linalg.inv(spread[fits])
    is_grid = np.abs(np.linalg.det(fitted)) > _LEAST_TURN * (fitted**2).sum(axis=(1, 2))
    linear[np.flatnonzero(fits)[is_grid]] = fitted[is_grid]
    on_plane = np.empty((len(axis), 3, 3))
    on_plane[:, :2, :2], on_plane[:, 2] = linear, (0.0, 0.0, 1.0)
    on_plane[:, :2, 2] = middle - np.einsum("tab,tb->ta", linear, mean)
    return on_plane @ basis, cones


def _place(
    directions: NDArray[np.float64], forms: NDArray[np.float64], places: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Write the places of tiles (T, 3, side, side); returns their margins. directions: (T, side, side, 3)."""
    a, b, depth = np.moveaxis(np.einsum("tyxk,tak->tyxa", directions, forms), -1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        depth[~(depth > 0.0)] = np.nan  # where rays diverge too much the planes are discarded
        columns, rows = a / depth, b / depth
        columns -= np.arange(columns.shape[2])
        rows -= np.arange(rows.shape[1])[:, None]
        places[:, 0], places[:, 1], places[:, 2] = columns, rows, 1.0 / depth
    farthest = np.maximum(np.abs(columns), np.abs(rows)).reshape(len(forms), -1)
    return np.asarray(np.where(np.isfinite(farthest), farthest, 0.0).max(axis=1) * 1.000001 + 1e-6)
