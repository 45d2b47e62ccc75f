"""Adaptive sampling: which texels have enough samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.maps import Lightmap

FIRST_LOOK = 64
"""Samples after which a texel is first checked; then whenever they have doubled."""

ERROR, DEVIATIONS = 0.01, 2.58
"""A texel has enough samples when its mean is within ERROR at DEVIATIONS standard deviations, a confidence of 99 %.
Source: the values of Unity's lightmapper."""


def is_looked_at(samples: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(N,) bool: texels whose number of samples calls for a check."""
    return (samples >= FIRST_LOOK) & (samples & (samples - 1) == 0)


def until_next_look(samples: NDArray[np.int32]) -> int:
    """How many samples all of these texels may get before one is due for a check."""
    doubled = 1 << (np.floor(np.log2(np.maximum(samples, 1))).astype(np.int64) + 1)
    return int((np.maximum(FIRST_LOOK, doubled) - samples).min())


def is_enough(lightmap: Lightmap) -> NDArray[np.bool_]:
    """(N,) bool: texels whose mean is probably within `ERROR`; never a texel without light."""
    error = np.sqrt(lightmap.variance.astype(np.float64) / np.maximum(lightmap.samples, 1))
    return (lightmap.luminance > 0.0) & (DEVIATIONS * error <= ERROR * lightmap.luminance)
