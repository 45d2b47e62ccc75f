"""What makes a point's times less trustworthy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.harness.processes.idle import BUSY_SHARE_OF_ALL_CORES, Occupancy
from experiments.harness.records import Record
from experiments.results.settings import without_numbers
from experiments.workloads import find_workload
from experiments.workloads.images import say_wrong_image

_OUT_OF_PROPORTION = 10.0
"""Samples this many times longer or shorter than their method's median flag a point."""

WRONG = "wrong"
"""Status of a point that was timed and whose image is wrong: figures and ratios leave its time out."""


@dataclass(frozen=True)
class TimeWarning:
    """A reason to distrust the times of a process. badness: the larger, the worse, among those of one kind."""

    text: str
    badness: float = 0.0


def cores_of(record: Record) -> int | None:
    """Those that the process could run on, hardware threads counted; None where nobody knows."""
    affinity = record.environment.get("affinity")
    return len(affinity) if affinity else record.environment.get("logical_cores")


def warnings_of(record: Record) -> list[TimeWarning] | None:
    """Reasons to distrust the times of a process, None without any."""
    own = _judged(record)
    if own is None:
        return None
    warnings = passing_warnings(record)
    if min(own) < 1e-3:
        warnings.append(TimeWarning("shortest sample is below 1 ms"))
    asked = record.configuration.get("rounds")
    if asked is not None and len(own) < asked:
        warnings.append(TimeWarning(f"{len(own)} of {asked} rounds", -len(own)))
    cores, threads = cores_of(record), record.results.get("threads")
    if cores and threads and threads > cores:
        warnings.append(TimeWarning(f"{threads} threads on {cores} cores", -cores))
    return warnings or None


def say_warnings(processes: Sequence[Sequence[TimeWarning]]) -> str:
    """The warnings of a point's processes in words: each kind once, in the order in which they come, by its worst."""
    worst: dict[str, TimeWarning] = {}
    for warning in (warning for warnings in processes for warning in warnings):
        kind = without_numbers(warning.text)
        if kind not in worst or warning.badness > worst[kind].badness:
            worst[kind] = warning
    return "; ".join(warning.text for warning in worst.values())


def passing_warnings(record: Record) -> list[TimeWarning]:
    """Those of `warnings_of` that came from a disturbance, so that another process may be without them."""
    own = _judged(record)
    if own is None:
        return []
    warnings = []
    q1, median, q3 = np.quantile(own, [0.25, 0.5, 0.75])
    if q3 - q1 >= 0.1 * median:
        spread = (q3 - q1) / median
        warnings.append(TimeWarning(f"spread is {spread:.0%} of the median", spread))
    longest = max(max(values) / np.median(values) for values in record.samples.values())
    if longest > _OUT_OF_PROPORTION:
        warnings.append(TimeWarning(f"longest sample is {longest:,.0f} times the median", longest))
    shortest = max(np.median(values) / min(values) for values in record.samples.values())
    if shortest > _OUT_OF_PROPORTION:
        warnings.append(TimeWarning(f"median is {shortest:,.0f} times the shortest sample", shortest))
    taken = sum(record.results.get(name) or 0.0 for name in ("others_share", "stolen_share"))
    if taken > BUSY_SHARE_OF_ALL_CORES:
        warnings.append(TimeWarning(f"others took {taken:.0%} of its cores", taken))
    return warnings


def was_idle(record: Record) -> bool:
    """Whether the machine was idle while the point was measured; False where nobody knows."""
    others = record.results.get("others_share")
    return others is not None and Occupancy(others, record.results.get("stolen_share")).is_idle


def why_wrong(record: Record) -> str | None:
    """Why no time of a record may be compared: its image is wrong. Where nothing is timed, that is a result."""
    return None if _judged(record) is None else say_wrong_image(record.results)


def _judged(record: Record) -> list[float] | None:
    """The samples by which a record is judged, None where there are none."""
    judged = find_workload(record.configuration["workload"]).judged
    return None if record.status != "ok" or judged is None else record.samples[judged]
