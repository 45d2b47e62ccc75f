"""Sub-pixel positions for progressive pictures: a low-discrepancy sequence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.whole_numbers import is_whole_number

_PLASTIC = 1.324717957244746
"""The plastic ratio, the real root of x^3 = x + 1."""


def sub_pixel_offsets(count: int, first: int = 0) -> NDArray[np.float64]:
    """Offsets of a sequence whose prefixes fill a pixel evenly; offset 0 is the pixel's centre.

    Parameters
    ----------
    count, first : int
        Offsets `first`, `first` + 1, ..., so many of them.

    Returns
    -------
    (count, 2) ndarray of float64
        In [0, 1).

    Raises
    ------
    InputError
        Unless both are whole numbers of at least 0.

    Notes
    -----
    Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018 (the R2 sequence).

    Examples
    --------
    >>> import atra
    >>> atra.sub_pixel_offsets(2).round(3).tolist()
    [[0.5, 0.5], [0.255, 0.07]]
    """
    if not all(is_whole_number(value) and value >= 0 for value in (count, first)):
        raise InputError(f"count is {count!r} and first is {first!r}, expected whole numbers of at least 0")
    index = np.arange(int(first), int(first) + int(count), dtype=np.float64)[:, None]
    return (0.5 + index * [1 / _PLASTIC, 1 / _PLASTIC**2]) % 1.0
