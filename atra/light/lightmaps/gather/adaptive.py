"""Adaptive sampling: which texels have samples enough."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.maps import Lightmap

FIRST_LOOK = 64
"""Samples after which a texel is looked at; then whenever it has twice as many, however samples were grouped."""

ERROR, DEVIATIONS = 0.01, 2.58
"""Of the mean, and of a normal distribution, within which 99 % lie. Source: the values of Unity's lightmapper."""


def is_looked_at(samples: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(N,) bool: texels that have just as many samples as a look takes."""
    return (samples >= FIRST_LOOK) & (samples & (samples - 1) == 0)


def until_next_look(samples: NDArray[np.int32]) -> int:
    """How many samples all these texels may get until one of them is looked at."""
    doubled = 1 << (np.floor(np.log2(np.maximum(samples, 1))).astype(np.int64) + 1)
    return int((np.maximum(FIRST_LOOK, doubled) - samples).min())


def is_enough(lightmap: Lightmap) -> NDArray[np.bool_]:
    """(N,) bool: texels whose mean is likely as near to the truth as `ERROR` says; of no texel that found no light."""
    error = np.sqrt(lightmap.variance.astype(np.float64) / np.maximum(lightmap.samples, 1))
    return (lightmap.luminance > 0.0) & (DEVIATIONS * error <= ERROR * lightmap.luminance)
