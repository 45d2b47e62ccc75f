"""The processes that measured a point, and which of them are replaced by new ones."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import inf, log, log1p
from statistics import median
from typing import Any

from atra.errors import InputError
from experiments.harness.environment import describe_difference
from experiments.harness.records import Record, without_limits
from experiments.results.time_warnings import passing_warnings
from experiments.workloads import find_workload

BAND = 0.1
"""A process whose canary strays by more than this from the median of all is measured again, and left out if it still
strays. The canary is rtcIntersect1 over ray packets, which no method of a point can change, only the machine. The band
is about three standard errors: on an idle machine the rounds of one process scatter by 4 to 7 %, and the median of
three, as `sweep=paper` has, by two thirds of that. Within the band, noise is left to intervals."""

FEWEST = 5
"""Fewest records of one scene and view whose median is used."""

ALIKE = (
    "mesh_sha256",
    *("eye", "target", "up", "fov_y_degrees", "width", "height"),
    *("workload", "workload_options", "threads", "build_quality", "ties", "instruction_set"),
)
"""Settings that the canary depends on."""

FEWEST_IN_EARNEST = 5
"""A point with fewer processes is a quick look, which should not take twice as long: what was disturbed there stays,
with its warning."""

WHY = f"disturbed, or rtcIntersect1 over packets strayed by over {BAND:.0%}"

_TIMES = "measured_again"
"""Name of the result that tells how many processes a record has replaced."""


def key_of(configuration: Mapping[str, Any]) -> str:
    """What tells a configuration from others but for their limits, to be looked up by."""
    return json.dumps(without_limits(configuration), sort_keys=True)


def by_point(records: Iterable[Record]) -> list[list[Record]]:
    """Records that differ in their process alone, or in their limits, together, by the number of the process."""
    points: dict[str, list[Record]] = {}
    for record in records:
        alike = {name: value for name, value in record.configuration.items() if name != "process"}
        points.setdefault(key_of(alike), []).append(record)
    return [sorted(of_point, key=lambda record: record.configuration.get("process", 0)) for of_point in points.values()]


def drifted(records: Iterable[Record]) -> set[str]:
    """The `point_id` of every record whose canary is farther than BAND from the median of those it should equal."""
    alike: dict[str, dict[str, float]] = {}
    for record in records:
        value = _canary(record)
        if value is not None:
            key = json.dumps([record.configuration.get(name) for name in ALIKE], sort_keys=True)
            alike.setdefault(key, {})[record.point_id] = log(value)
    groups = [(group, median(group.values())) for group in alike.values() if len(group) >= FEWEST]
    return {name for group, usual in groups for name, value in group.items() if abs(value - usual) > log1p(BAND)}


def _canary(record: Record) -> float | None:
    """The canary of a measured record, None where its workload has none."""
    return find_workload(record.configuration["workload"]).canary(record) if record.status == "ok" else None


def to_replace(records: Mapping[str, Record], repeats: float = inf) -> list[str]:
    """Names of the records that a new process should replace: those that strayed, and, of points with
    `FEWEST_IN_EARNEST` processes or more, those that were disturbed. Records that have replaced so many others as
    `repeats` are left out."""
    out = drifted(records.values())
    for of_point in by_point(records.values()):
        if len(of_point) >= FEWEST_IN_EARNEST:
            out.update(record.point_id for record in of_point if passing_warnings(record))
    return [name for name, record in records.items() if record.point_id in out and _times(record) < repeats]


def as_replacement(record: Record, before: Record) -> Record:
    """The record with the number of processes it has replaced: that of `before`, which it replaces, and one more."""
    return replace(record, results=record.results | {_TIMES: _times(before) + 1})


def is_replacement(record: Record) -> bool:
    """Whether the process of a record has replaced another."""
    return _times(record) > 0


def _times(record: Record) -> int:
    return int(record.results.get(_TIMES) or 0)


def check_one_environment(records: Iterable[Record]) -> None:
    """Raise InputError when two records come from different machines or software, naming the field: their ratio would
    mean nothing. What was not measured has no times, and the machine that launches jobs says of some points that they
    cannot be."""
    first: Record | None = None
    for record in records:
        if record.status != "ok":
            continue
        first = first or record
        difference = describe_difference(first.environment, record.environment)
        if difference is not None:
            raise InputError(
                f"records {first.point_id} and {record.point_id} are from two environments: {difference}; "
                "measure both on one machine with one version, or keep them in two results_dir"
            )
