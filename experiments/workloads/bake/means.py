"""Mean light of all texels of a map, and how sure that is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def mean_and_error(light: NDArray[Any], variance: NDArray[Any], samples: Any) -> tuple[float, float]:
    """Of (N,) means and variances of one sample, of so many samples each: the mean of all, and its standard error."""
    return float(light.mean()), float(np.sqrt((variance.astype(np.float64) / samples).sum()) / len(light))
