"""Readings of the paper's baseline, "the standard method that does not use ours", and gains over each.

The paper's 1 x 1 may find the nearest hit, as anybody's renderer does, or gather every hit of a ray, as its aligned
runs must. Its section 5, where the method may lose when only the nearest hit is wanted, speaks for the second. Where
every hit is wanted, and not the nearest alone, both sides gather them, and nobody can stop early.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import pandas as pd

from experiments.paper.evidence import SPLITS, Scene, measured_at
from experiments.results.statistics import Estimate, NotMeasuredError, Sample, best_of
from experiments.results.verdicts import exact
from experiments.workloads.frame import FRAME
from experiments.workloads.gather import GATHER

K = TypeVar("K", bound=Hashable)


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


def baseline(scene: Scene, reading: Reading, packet_width: int = 1) -> Estimate:
    """Speed-up of the baseline itself over that against which all is measured. Raises NotMeasuredError."""
    if not reading.gathers:
        return exact(1.0)
    return scene.sample("speedup", reading.workload, (1, 1), culling=False, packet_width=packet_width).estimate()


def best(samples: Mapping[K, Sample]) -> tuple[K, Estimate]:
    """As `best_of`."""
    pool = next((sample.pool for sample in samples.values()), None)
    return best_of({name: sample.values for name, sample in samples.items()}, pool)


def over_splits(
    scene: Scene, reading: Reading, culling: bool, packet_width: int = 1, splits: Sequence[int] = SPLITS
) -> tuple[dict[int, Sample], dict[int, str]]:
    """By number of horizontal splits, the speed-ups that were measured, and why the others were not."""
    column = "speedup_vs_packets" if packet_width > 1 and not reading.gathers else "speedup"
    point = {"culling": culling, "packet_width": packet_width}
    return measured_at(splits, lambda split: scene.sample(column, reading.workload, (split, 1), **point))


@dataclass(frozen=True)
class Gain:
    """splits: the best number of horizontal splits. estimate: of its gain over the baseline. missing: why some number
    of splits, which might be better still, was not measured; None where all were."""

    splits: int
    estimate: Estimate
    missing: str | None


def best_gain(
    scene: Scene, reading: Reading, packet_width: int = 1, over: int | None = None,
    splits: Sequence[int] = SPLITS, culling: bool = True,
) -> Gain:  # fmt: skip
    """over: packet width of a baseline that gathers all hits, None = the same. splits: numbers of them to choose from.

    Raises NotMeasuredError.
    """
    speedups, missing = over_splits(scene, reading, culling, packet_width, splits)
    why = next(iter(missing.values()), None)
    if not speedups:
        raise NotMeasuredError(why)
    split, value = best(speedups)
    return Gain(split, value.over(baseline(scene, reading, over or packet_width)), why)
