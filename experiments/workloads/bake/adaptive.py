"""Bias of adaptive sampling: a map whose texels are left when they seem certain, beside an independent full one."""

from __future__ import annotations

from time import perf_counter

from atra.light import Baker
from experiments.workloads.bake.means import mean_and_error, ratio_and_error


def adaptive_bias(adaptive: Baker, full: Baker, samples: int) -> dict[str, float]:
    """What is gained, and how far the mean light of all texels is off.

    adaptive, full: bakers of the same texels and of other random numbers, with as many samples so far each.
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
