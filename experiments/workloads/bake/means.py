"""Mean light of all texels of a map with its standard error, and the bias of adaptive sampling."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light import Baker


def mean_and_error(light: NDArray[Any], variance: NDArray[Any], samples: Any) -> tuple[float, float]:
    """Mean light of all texels and its standard error, from (N,) means, variances of one sample, and sample counts."""
    return float(light.mean()), float(np.sqrt((variance.astype(np.float64) / samples).sum()) / len(light))


def ratio_and_error(upper: tuple[float, float], lower: tuple[float, float]) -> tuple[float, float]:
    """The quotient of two independent means, each with its standard error, and the standard error of the quotient."""
    ratio = upper[0] / lower[0]
    return ratio, ratio * float(np.hypot(upper[1] / upper[0], lower[1] / lower[0]))


def adaptive_bias(adaptive: Baker, full: Baker, samples: int) -> dict[str, float]:
    """Speed-up of adaptive sampling, and the bias of the mean light of all texels.

    adaptive, full: bakers of the same texels with different seeds and equally many samples so far.
    """
    taken, unfinished = {adaptive: 0.0, full: 0.0}, [adaptive, full]
    while unfinished:
        for baker in tuple(unfinished):  # in turns, so that drift cancels
            start = perf_counter()
            if not baker.advance(samples):
                unfinished.remove(baker)
            taken[baker] += perf_counter() - start
    maps = adaptive.maps, full.maps
    ratio, error = ratio_and_error(*(mean_and_error(one.luminance, one.variance, one.samples) for one in maps))
    return {
        "adaptive_bias": ratio - 1.0,
        "adaptive_bias_error": error,
        "adaptive_left_out": 1.0 - float(adaptive.samples.sum()) / float(full.samples.sum()),
        "adaptive_speedup": taken[full] / taken[adaptive],
    }
