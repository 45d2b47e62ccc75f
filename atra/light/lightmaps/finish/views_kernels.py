"""Kernels of views: the sky that they show."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel
from atra.light.surface_kernels import sky_colour


class SkyTables(NamedTuple):
    """As in `Surfaces`."""

    sky: NDArray[np.float32]
    panorama: NDArray[np.float32]


@float_kernel
def look_into_sky(tables, ways, colours):  # type: ignore[no-untyped-def]
    """Put the sky's radiance along (N, 3) float32 unit vectors into (N, 3) float32."""
    for i in range(len(ways)):
        way = ways[i, 0], ways[i, 1], ways[i, 2]
        colours[i, 0], colours[i, 1], colours[i, 2] = sky_colour(tables, way)
