"""Which processes are replaced by new ones: those that strayed, and those that were disturbed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from experiments.harness.records import Record
from experiments.results.canary import BAND, strays
from experiments.results.doubts import passing_doubts

MOST_REPLACED = 3
"""How often a process is replaced by a new one."""

WHY = f"disturbed, or rtcIntersect1 over packets strayed by over {BAND:.0%}"


def to_replace(records: Mapping[str, Record]) -> list[str]:
    """Names of the records that a new process should replace."""
    out = strays(list(records.values()))
    return [
        name
        for name, one in records.items()
        if _replaced(one) < MOST_REPLACED and (one.point_id in out or passing_doubts(one))
    ]


def as_replacement(record: Record, before: Record) -> Record:
    """A record that tells how often it was measured again."""
    return replace(record, results=record.results | {"measured_again": _replaced(before) + 1})


def _replaced(record: Record) -> int:
    return int(record.results.get("measured_again") or 0)
