"""Pixels as kernels read them: their rays, and their hits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View
from atra.hits import Hits
from atra.light.pictures.film import Film
from atra.light.pictures.path_kernels import Pixels

_GOLDEN = 0x9E3779B9
"""Odd, so that 2^32 samples have different keys; those of neighbouring samples are far apart."""

_NOTHING = np.zeros(0, np.uint32)


def pixels_of(camera: View, film: Film, offset: tuple[float, float], hits: Hits | None) -> Pixels:
    """The next sample of all pixels, at this sub-pixel offset. hits: what they see there; None: unknown, and each pixel
    has an offset of its own."""
    key = film.samples * _GOLDEN & 0xFFFFFFFF
    if hits is None:
        return Pixels(_lines(camera, (0.0, 0.0)), film.places, True, _NOTHING, 0, key)
    stride, (height, width) = hits.prim_id.strides[0] // 4, hits.prim_id.shape
    prim_ids = np.lib.stride_tricks.as_strided(hits.prim_id, ((height - 1) * stride + width,), (4,))
    return Pixels(_lines(camera, offset), film.places, False, prim_ids, stride, key)


def _lines(camera: View, offset: tuple[float, float]) -> NDArray[np.float64]:
    """(6, 3) float64, `lines` of `Pixels`: rays are linear in the pixel's position."""
    origins, directions = camera.rays(np.array([0, 1, 0]), np.array([0, 0, 1]), offset)
    origins, directions = origins @ camera.axes + camera.eye, directions @ camera.axes
    steps = [values[k] - values[0] for k in (1, 2) for values in (origins, directions)]
    return np.array([origins[0], directions[0], *steps])
