"""The sky as the eye and mirrors see it."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, place_on
from atra.light.surface_kernels import GRADIENT, sky_colour


@njit
def background(surfaces, direction):  # type: ignore[no-untyped-def]
    """`sky_colour`, between texels of a panorama by bilinear interpolation."""
    if surfaces.sky[0] == GRADIENT:
        return sky_colour(surfaces, direction)
    texels = surfaces.panorama
    rows, columns = texels.shape[0], texels.shape[1]
    t, s = place_on(direction)
    y, x = t * rows - 0.5, s * columns - 0.5
    above, left = np.floor(y), np.floor(x)
    down, across = np.float32(y - above), np.float32(x - left)
    y0, y1 = max(np.int64(above), 0), min(np.int64(above) + 1, rows - 1)
    x0, x1 = np.int64(left) % columns, (np.int64(left) + 1) % columns
    wa, wb, wc, wd = (ONE - across) * (ONE - down), across * (ONE - down), (ONE - across) * down, across * down
    a, b, c, d = texels[y0, x0], texels[y0, x1], texels[y1, x0], texels[y1, x1]
    return (
        wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0],
        wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1],
        wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2],
    )
