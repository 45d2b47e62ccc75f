"""Readings of the paper's baseline, "the standard method that does not use ours", and gains over each.

The paper's 1 x 1 may find the nearest hit, as anybody's renderer does, or gather every hit of a ray, as its aligned
runs must. Its section 5, where the method may lose when only the nearest hit is wanted, speaks for the second. Where
every hit is wanted, and not the nearest alone, both sides gather them, and nobody can stop early.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from experiments.paper.evidence import SPLITS, NotMeasuredError, SceneRows, best, estimate, measured_at
from experiments.results.statistics import Estimate
from experiments.workloads.frame import FRAME
from experiments.workloads.gather import GATHER


@dataclass(frozen=True)
class Reading:
    """name: as shown. rays: those of the baseline, in words. gathers: the baseline gathers all hits, being the
    aligned tracer itself at 1 x 1 without culling, with rays of the same kind; otherwise it is rtcIntersect1 per pixel,
    of packets the fastest ray packets. workload: of the rows that are judged."""

    name: str
    rays: str
    gathers: bool
    workload: str = FRAME.name


NEAREST = Reading("nearest hit", "rays that look for the nearest hit alone", gathers=False)
ALL_HITS = Reading("all hits", "rays that gather all hits", gathers=True)
EVERY_HIT = Reading(
    "every hit wanted", "rays that gather all hits, where all are wanted", gathers=True, workload=GATHER.name
)
_PER_PIXEL = Reading("every hit, per pixel", "rays per pixel that gather all hits", False, GATHER.name)

READINGS = (NEAREST, ALL_HITS, EVERY_HIT)

UNDER: Mapping[str, Mapping[str, Reading]] = {
    "": {"": NEAREST},
    "each": {reading.name: reading for reading in READINGS},
    "nearest": {NEAREST.name: NEAREST},
    "alike": {"": NEAREST, EVERY_HIT.name: EVERY_HIT},
}
"""By what claims.toml says, the readings that a claim is judged under. alike: the baseline does not matter, but whether
the nearest hit is wanted or every one."""

PACKETS_OVER = (
    ("ray packets, nearest hit", NEAREST, False),
    ("packets that gather all hits", ALL_HITS, False),
    ("single rays that gather all hits", ALL_HITS, True),
    ("ray packets that gather, every hit wanted", _PER_PIXEL, False),
    ("packets at 1 \N{MULTIPLICATION SIGN} 1 that gather, every hit wanted", EVERY_HIT, False),
)
"""What the gains of packets are over: in words, the reading, and whether it is over single rays."""


def readings_of(processes: pd.DataFrame | None) -> tuple[Reading, ...]:
    """Those of whose workloads a table has rows; of a table without any, those of single frames."""
    measured = set() if processes is None or "workload" not in processes else set(processes["workload"])
    return tuple(reading for reading in READINGS if reading.workload in measured) or (NEAREST, ALL_HITS)


def baseline_speedup(scene: SceneRows, reading: Reading, packet_width: int = 1) -> Estimate | None:
    """Speed-up of the baseline itself over rtcIntersect1; None where that is what all is measured against.

    Raises NotMeasuredError.
    """
    if not reading.gathers:
        return None
    return estimate(scene.speedups((1, 1), culling=False, packet_width=packet_width, workload=reading.workload))


def relative_to_baseline(value: Estimate, scene: SceneRows, reading: Reading, packet_width: int = 1) -> Estimate:
    """A speed-up over rtcIntersect1 as one over the baseline of a reading. Raises NotMeasuredError."""
    base = baseline_speedup(scene, reading, packet_width)
    return value if base is None else value.over(base)


@dataclass(frozen=True)
class BestGain:
    """splits: the best number of horizontal splits. gain: over the baseline. missing: why some number of splits, which
    might be better still, was not measured; None where all were."""

    splits: int
    gain: Estimate
    missing: str | None


def best_gain(
    scene: SceneRows, reading: Reading, packet_width: int = 1, over: int | None = None,
    splits: Sequence[int] = SPLITS, culling: bool = True,
) -> BestGain:  # fmt: skip
    """over: packet width of a baseline that gathers all hits, None = the same. splits: numbers of them to choose from.

    Raises NotMeasuredError.
    """
    column = "speedup_vs_packets" if packet_width > 1 and not reading.gathers else "speedup"
    speedups, missing = measured_at(
        splits,
        lambda split: scene.speedups(
            (split, 1), culling=culling, packet_width=packet_width, column=column, workload=reading.workload
        ),
    )
    if not speedups:
        raise NotMeasuredError(next(iter(missing.values())))
    split, value = best(speedups)
    gain = relative_to_baseline(value, scene, reading, over or packet_width)
    return BestGain(split, gain, next(iter(missing.values()), None))
