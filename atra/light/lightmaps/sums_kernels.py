"""Sums of a texel's samples: their places in a row, and how the mean has changed."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light import numbers_kernels

DIRECT, INDIRECT, ENVIRONMENT, OPEN, BACK = 0, 3, 6, 9, 10
CHANNELS, RESULTS = 9, 11
"""Results of a sample: three kinds of light with three channels; then 1 or 0 for "nothing near by" and "sees a back
face"."""

SQUARE, HALF, CHANGE, BEFORE = RESULTS, RESULTS + 1, RESULTS + 2, RESULTS + 3
SUMS = RESULTS + 4
"""float64 numbers of a texel: sums of its results and of the squared luminance of all light; its mean luminance when
its samples last were a power of two; and by how much that differed from the mean of half as many, squared, then and one
doubling earlier."""

LUMINANCE = tuple(np.float32(weight) for weight in numbers_kernels.LUMINANCE)
"""Weights of linear RGB (Rec. 709), float32."""


@njit(forceinline=True)
def note_doubling(sums, texel, samples):  # type: ignore[no-untyped-def]
    """Keep how a texel's mean has changed, if its samples have doubled."""
    if samples & (samples - 1) != 0:
        return
    total = 0.0
    for channel in range(3):
        light = sums[texel, DIRECT + channel] + sums[texel, INDIRECT + channel] + sums[texel, ENVIRONMENT + channel]
        total += np.float64(LUMINANCE[channel]) * light
    change = total / samples - sums[texel, HALF]
    sums[texel, BEFORE], sums[texel, CHANGE] = sums[texel, CHANGE], change * change
    sums[texel, HALF] += change
