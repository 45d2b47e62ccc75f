"""Which processes are replaced by new ones: those that strayed, and of points with several, those disturbed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

from experiments.harness.records import Record
from experiments.results.canary import BAND, strays
from experiments.results.doubts import passing_doubts

MOST_REPLACED = 3
"""How often a process is replaced by a new one."""

FEWEST_PROCESSES = 5
"""A point with fewer is a quick look, which should not take twice as long: what was disturbed there stays, with its
doubt."""

WHY = f"disturbed, or rtcIntersect1 over packets strayed by over {BAND:.0%}"


def to_replace(records: Mapping[str, Record]) -> list[str]:
    """Names of the records that a new process should replace."""
    out, processes = strays(list(records.values())), Counter(map(_point, records.values()))
    return [
        name
        for name, one in records.items()
        if _replaced(one) < MOST_REPLACED
        and (one.point_id in out or (processes[_point(one)] >= FEWEST_PROCESSES and passing_doubts(one)))
    ]


def as_replacement(record: Record, before: Record) -> Record:
    """A record that tells how often it was measured again."""
    return replace(record, results=record.results | {"measured_again": _replaced(before) + 1})


def _replaced(record: Record) -> int:
    return int(record.results.get("measured_again") or 0)


def _point(record: Record) -> str:
    """What the processes of one point have in common."""
    return json.dumps(
        {name: value for name, value in record.configuration.items() if name != "process"}, sort_keys=True
    )
