"""The canary: rtcIntersect1 over ray packets, which no method of a point can change, only the machine."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from statistics import median

from experiments.harness.records import Record
from experiments.workloads import find_workload

BAND = 0.1
"""A process whose canary strays by more than this from the median of all is measured again, and left out if it still
strays. About three standard errors: on an idle machine the rounds of one process scatter by 4 to 7 %, and the median of
three, as `sweep=paper` has, by two thirds of that. Within the band, noise is left to intervals."""

FEWEST = 5
"""Fewest records of one scene and view whose median is used."""

ALIKE = (
    "mesh_sha256",
    *("eye", "target", "up", "fov_y_degrees", "width", "height"),
    *("workload", "workload_options", "threads", "build_quality", "ties", "instruction_set"),
)
"""Settings that the canary depends on."""


def drifted(records: Sequence[Record]) -> set[str]:
    """The `point_id` of every record whose canary is farther than BAND from the median of those it should equal."""
    alike: dict[str, dict[str, float]] = {}
    for record in records:
        value = canary(record)
        if value is not None:
            key = json.dumps([record.configuration.get(name) for name in ALIKE], sort_keys=True)
            alike.setdefault(key, {})[record.point_id] = math.log(value)
    out: set[str] = set()
    for group in alike.values():
        if len(group) >= FEWEST:
            usual = median(group.values())
            out.update(name for name, value in group.items() if abs(value - usual) > math.log1p(BAND))
    return out


def canary(record: Record) -> float | None:
    """The canary of a measured record, None where its workload has none."""
    if record.status != "ok":
        return None
    return find_workload(record.configuration["workload"]).canary(record)
