"""What makes a point's times less trustworthy."""

from __future__ import annotations

import numpy as np

from experiments.harness.environment import BUSY_SHARE
from experiments.harness.processes.quiet import Busy
from experiments.harness.records import Record
from experiments.workloads import find_workload

_OUT_OF_PROPORTION = 10.0
"""Samples this many times longer or shorter than their method's median make a point doubtful."""


def cores_of(record: Record) -> int | None:
    """Those that the process could run on, hardware threads counted; None where nobody knows."""
    affinity = record.environment.get("affinity")
    return len(affinity) if affinity else record.environment.get("logical_cores")


def doubts_of(record: Record) -> str | None:
    """Reasons to distrust the times of a point, None without any."""
    own = _judged(record)
    if own is None:
        return None
    doubts = passing_doubts(record)
    if min(own) < 1e-3:
        doubts.append("shortest sample is below 1 ms")
    asked = record.configuration.get("rounds")
    if asked is not None and len(own) < asked:
        doubts.append(f"{len(own)} of {asked} rounds")
    cores, threads = cores_of(record), record.results.get("threads")
    if cores and threads and threads > cores:
        doubts.append(f"{threads} threads on {cores} cores")
    return "; ".join(doubts) or None


def passing_doubts(record: Record) -> list[str]:
    """Those of `doubts_of` that came from a disturbance, so that another process may be without them."""
    own = _judged(record)
    if own is None:
        return []
    doubts = []
    q1, median, q3 = np.quantile(own, [0.25, 0.5, 0.75])
    if q3 - q1 >= 0.1 * median:
        doubts.append(f"spread is {(q3 - q1) / median:.0%} of the median")
    longest = max(max(values) / np.median(values) for values in record.samples.values())
    if longest > _OUT_OF_PROPORTION:
        doubts.append(f"longest sample is {longest:,.0f} times the median")
    shortest = max(np.median(values) / min(values) for values in record.samples.values())
    if shortest > _OUT_OF_PROPORTION:
        doubts.append(f"median is {shortest:,.0f} times the shortest sample")
    taken = sum(record.results.get(name) or 0.0 for name in ("others_share", "stolen_share"))
    if taken > BUSY_SHARE:
        doubts.append(f"others took {taken:.0%} of its cores")
    return doubts


def was_quiet(record: Record) -> bool:
    """Whether the machine was quiet while the point was measured; False where nobody knows."""
    others, cores = record.results.get("others_share"), cores_of(record)
    if others is None or cores is None:
        return False
    return Busy(others * cores, (record.results.get("stolen_share") or 0.0) * cores).is_quiet


def _judged(record: Record) -> list[float] | None:
    """The samples by which a record is judged, None where there are none."""
    judged = find_workload(record.configuration["workload"]).judged
    return None if record.status != "ok" or judged is None else record.samples[judged]
