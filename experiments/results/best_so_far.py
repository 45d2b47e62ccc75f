"""The fastest split so far of each scene, shown while a sweep runs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from statistics import fmean
from typing import Any

import numpy as np

from experiments.harness.records import Record
from experiments.methods import find_method
from experiments.methods.naming import say_point
from experiments.results.canary import ALIKE
from experiments.results.processes import by_point
from experiments.workloads import find_workload
from experiments.workloads.baselines import SINGLE


def best_splits(records: Iterable[Record]) -> list[str]:
    """One line for each scene and workload: the fastest split, beside single rays of the same rounds where those were
    timed, too. A split is judged by the mean over its processes.

    Only methods that split the image count. A scene measured with several cameras, sizes or threads has no single best
    split and no line.
    """
    fastest: dict[str, dict[str, tuple[float, str]]] = {}
    for of_point in by_point(one for one in records if _is_timed_split(one)):
        configuration = of_point[0].configuration
        label = f"{configuration['scene']}, {configuration['workload']}"
        alike = json.dumps([configuration.get(name) for name in ALIKE], sort_keys=True)
        cost, said = _cost(of_point)
        known = fastest.setdefault(label, {}).get(alike)
        if known is None or cost < known[0]:
            fastest[label][alike] = cost, f"{label}: {say_point(_row(of_point[0]))}: {said}"
    return [line for of_label in fastest.values() if len(of_label) == 1 for _, line in of_label.values()]


def _is_timed_split(record: Record) -> bool:
    configuration = record.configuration
    is_timed = record.status == "ok" and find_workload(configuration["workload"]).judged in record.samples
    return is_timed and find_method(configuration["method"]).has_cells


def _cost(of_point: Sequence[Record]) -> tuple[float, str]:
    """What ranks a point, less is better, and in words: its time as a share of that of single rays, which what else
    runs on the machine slows alike; or its time, where none were traced."""
    judged = find_workload(of_point[0].configuration["workload"]).judged
    own = [np.asarray(record.samples[judged or ""]) for record in of_point]
    if all(SINGLE in record.samples for record in of_point):
        pairs = zip(own, of_point, strict=True)
        share = fmean(float(np.median(time_s / record.samples[SINGLE])) for time_s, record in pairs)
        return share, f"{1 / share:.2f}x rtcIntersect1"
    time_s = fmean(float(np.median(one)) for one in own)
    return time_s, f"{time_s * 1e3:.1f} ms"


def _row(record: Record) -> dict[str, Any]:
    """What the point is called by: its method with the options that ran."""
    options = record.configuration.get("method_options", {})
    told = {name: record.results[name] for name in options if name in record.results}
    return {"method": record.configuration["method"], **options, **told}
