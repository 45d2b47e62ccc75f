"""Mean light of all texels of a map, and how sure that is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def mean_and_error(light: NDArray[Any], variance: NDArray[Any], samples: Any) -> tuple[float, float]:
    """Of (N,) means and variances of one sample, of so many samples each: the mean of all, and its standard error."""
    return float(light.mean()), float(np.sqrt((variance.astype(np.float64) / samples).sum()) / len(light))


def ratio_and_error(upper: tuple[float, float], lower: tuple[float, float]) -> tuple[float, float]:
    """The quotient of two means, each with its standard error, which do not hang on each other, and that of it."""
    ratio = upper[0] / lower[0]
    return ratio, ratio * float(np.hypot(upper[1] / upper[0], lower[1] / lower[0]))
