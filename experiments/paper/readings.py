"""Two readings of the paper's baseline, "the standard method that does not use ours", and gains over either.

The paper's 1 x 1 may find the nearest hit, as anybody's renderer does, or gather every hit of a ray, as its aligned
runs must. Its section 5, where the method may lose when only the nearest hit is wanted, speaks for the second.
"""

from __future__ import annotations

from dataclasses import dataclass

from experiments.paper.evidence import NotMeasuredError, SceneRows, best, estimate
from experiments.results.estimates import Estimate


@dataclass(frozen=True)
class Reading:
    """name: as shown. rays: those of the baseline, in words. gathers: the baseline gathers all hits, being the
    aligned tracer itself at 1 x 1 without culling, with rays of the same kind; otherwise it is rtcIntersect1 per pixel,
    of packets the fastest packets per pixel."""

    name: str
    rays: str
    gathers: bool


NEAREST = Reading("nearest hit", "rays that look for the nearest hit alone", gathers=False)
ALL_HITS = Reading("all hits", "rays that gather all hits", gathers=True)

READINGS = (NEAREST, ALL_HITS)


def start(scene: SceneRows, reading: Reading, packet_width: int = 1) -> Estimate | None:
    """Speed-up of the baseline itself over rtcIntersect1; None where that is what all is measured against.

    Raises NotMeasuredError.
    """
    if not reading.gathers:
        return None
    return estimate(scene.speedups((1, 1), culling=False, packet_width=packet_width))


def over_start(value: Estimate, scene: SceneRows, reading: Reading, packet_width: int = 1) -> Estimate:
    """A speed-up over rtcIntersect1 as one over the baseline of a reading. Raises NotMeasuredError."""
    base = start(scene, reading, packet_width)
    return value if base is None else value.over(base)


@dataclass(frozen=True)
class BestGain:
    """splits: the best number of horizontal splits, culling on. gain: over the baseline. missing: why some number of
    splits, which might be better still, was not measured; None where all were."""

    splits: int
    gain: Estimate
    missing: str | None


def best_gain(scene: SceneRows, reading: Reading, packet_width: int = 1, over: int | None = None) -> BestGain:
    """over: packet width of a baseline that gathers all hits, None = the same. Raises NotMeasuredError."""
    column = "speedup_vs_packets" if packet_width > 1 and not reading.gathers else "speedup"
    found, missing = scene.over_splits(culling=True, packet_width=packet_width, column=column)
    if not found:
        raise NotMeasuredError(next(iter(missing.values())))
    splits, value = best(found)
    gain = over_start(value, scene, reading, over or packet_width)
    return BestGain(splits, gain, next(iter(missing.values()), None))
