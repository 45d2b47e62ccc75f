"""Pixels as kernels read them: their rays, and their hits."""

from __future__ import annotations

from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.pictures.film import Film
from atra.light.pictures.path_kernels import Pixels
from atra.tracing.lens_rays import world_directions

_NOTHING = np.zeros(0, np.uint32)

NO_DIRECTIONS = np.zeros((3, 0, 0), np.float32)
"""Directions of a camera without a lens."""


class LensPixels:
    """Rays of all pixels through a lens; those of the last offset are kept. Without a lens there are none."""

    def __init__(self) -> None:
        self._offset: tuple[float, float] | None = None
        self._directions, self._blind = NO_DIRECTIONS, np.zeros((0, 0), np.bool_)

    def directions(self, camera: View, offset: tuple[float, float], threads: int) -> NDArray[np.float32]:
        """`directions` of `Pixels`. Pixels without a ray look along the view axis."""
        if isinstance(camera, LensView) and offset != self._offset:
            with closing(WorkerPool(threads)) as pool:
                self._offset, self._directions = offset, world_directions(camera, offset, pool)
            self._blind = np.isnan(self._directions[0])
            self._directions[:, self._blind] = camera.axes[2].astype(np.float32)[:, None]
        return self._directions

    def blackened(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        """An image (..., H, W, 3), changed in place: black where the last offset gave no ray."""
        if self._blind.any():
            image[..., self._blind, :] = 0.0
        return image


def pixels_of(
    camera: View,
    film: Film,
    offset: tuple[float, float],
    hits: Hits | None,
    directions: NDArray[np.float32] = NO_DIRECTIONS,
) -> Pixels:
    """The next sample of all pixels, at this sub-pixel offset. hits: what they see there; None: unknown, and each pixel
    has an offset of its own. directions: of `Pixels`."""
    if hits is None:
        return Pixels(_lines(camera, (0.0, 0.0)), film.places, True, _NOTHING, 0, film.samples, NO_DIRECTIONS)
    stride, (height, width) = hits.prim_id.strides[0] // 4, hits.prim_id.shape
    prim_ids = np.lib.stride_tricks.as_strided(hits.prim_id, ((height - 1) * stride + width,), (4,))
    return Pixels(_lines(camera, offset), film.places, False, prim_ids, stride, film.samples, directions)


def _lines(camera: View, offset: tuple[float, float]) -> NDArray[np.float64]:
    """(6, 3) float64, `lines` of `Pixels`: rays are linear in the pixel's position."""
    if camera.lens is not None:  # all start at the eye
        return np.concatenate([[camera.eye], np.zeros((5, 3))])
    origins, directions = camera.rays(np.array([0, 1, 0]), np.array([0, 0, 1]), offset)
    origins, directions = origins @ camera.axes + camera.eye, directions @ camera.axes
    steps = [values[k] - values[0] for k in (1, 2) for values in (origins, directions)]
    return np.array([origins[0], directions[0], *steps])
