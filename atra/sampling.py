"""Where in their pixels the rays of successive frames go: a low-discrepancy sequence, for progressive pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError

# The plane's analogue of the golden ratio, the real root of x^3 = x + 1.
_PLASTIC = 1.324717957244746


def sub_pixel_offsets(count: int, first: int = 0) -> NDArray[np.float64]:
    """(count, 2) float64 in [0, 1): offsets `first`, `first` + 1, ... of a sequence of which every prefix is even.

    Offset 0 is the pixel's centre, so that the first frame of a progressive picture is the ordinary one.
    Raises InputError for a negative count or start.
    Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018 (the R2 sequence).
    """
    if count < 0 or first < 0:
        raise InputError(f"{count} offsets from number {first} on were asked for, expected no negative number")
    index = np.arange(first, first + count, dtype=np.float64)[:, None]
    return (0.5 + index * [1 / _PLASTIC, 1 / _PLASTIC**2]) % 1.0
