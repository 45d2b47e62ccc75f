"""The processes that measured a point, and which of them are replaced by new ones."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import inf
from typing import Any

from atra.errors import InputError
from experiments.harness.environment import describe_difference
from experiments.harness.records import Record, without_limits
from experiments.results.canary import BAND, drifted
from experiments.results.time_warnings import passing_warnings

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


def to_replace(records: Mapping[str, Record], repeats: float = inf) -> list[str]:
    """Names of the records that a new process should replace: those that strayed, and, of points with
    `FEWEST_IN_EARNEST` processes or more, those that were disturbed. Records that have replaced so many others as
    `repeats` are left out."""
    out = drifted(list(records.values()))
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
