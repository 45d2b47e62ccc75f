"""Points of a sweep measured elsewhere: what hands them to a launcher, what a job does, and what finds its record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from atra.errors import RecordError
from experiments.harness.configuration import Configuration, check_writable, records_folder
from experiments.harness.identity import current_environment, identity, identity_of, measure
from experiments.harness.point import Point
from experiments.harness.points import PlannedPoint, plan_points
from experiments.harness.processes.launching import run_worker
from experiments.harness.records import Record, load_record, read_record, write_record
from experiments.results.terminal import say_outcome
from scenes.loading import replace_missing_scenes

Launch = Callable[[Sequence[Sequence[str]]], Sequence[str | None]]
"""Measures points elsewhere, each given by its overrides. When it returns, their records are in the records folder; it
returns for each point why its job failed, None = it did not."""


def measure_launched(configuration: Configuration) -> None:
    """Measure one point of a launched sweep and leave its record in the records folder, unless it is there already."""
    if configuration.sweep.stand_ins:
        replace_missing_scenes([configuration.scene])
    (planned,) = plan_points([configuration])
    folder = records_folder(configuration)
    check_writable(folder)
    if still_true(read_record(folder, identity(planned.point, current_environment())), planned) is None:
        write_record(folder, measure(planned, partial(run_worker, results=folder.parent)))


def measure_batch(
    launch: Launch,
    points: Mapping[str, Point],
    overrides: Sequence[Sequence[str]],
    folder: Path,
    done: dict[str, Record],
    warn: Callable[[str], object],
) -> list[str]:
    """Have points measured together and add their records to `done`; returns what came of each, in words."""
    try:
        problems = launch(overrides)
    finally:  # an interrupt, too, leaves records of the batch
        found = _launched(points, folder, warn)
        done |= found
    return [
        say_outcome(found[name]) if name in found else f"no record: {problem or 'its job left none to use'}"
        for name, problem in zip(points, problems, strict=True)
    ]


def _launched(points: Mapping[str, Point], folder: Path, warn: Callable[[str], object]) -> dict[str, Record]:
    """The records of launched points, by this machine's identity of the point.

    Another machine wrote them under an identity of its own, so they are known by their configuration; those of
    other code, whose numbers are no longer true, are not. make_table refuses if they are of several machines.
    """
    environment = current_environment()
    own = {name: read_record(folder, identity(point, environment), warn) for name, point in points.items()}
    found = {name: record for name, record in own.items() if record is not None}
    if len(found) == len(points):
        return found
    wanted = {key(point.configuration()): name for name, point in points.items()}
    elsewhere: dict[str, Record] = {}
    for path in sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime):
        try:
            record = load_record(folder, path.stem)
        except RecordError:  # perhaps of another sweep or version, and not ours to set aside
            continue
        name = None if record is None else wanted.get(key(record.configuration))
        if record is not None and name is not None and record.point_id == identity_of(record, points[name]):
            elsewhere[name] = record
    return elsewhere


def still_true(record: Record | None, planned: PlannedPoint) -> Record | None:
    """The record if measuring the point again would tell nothing new; a point that was skipped may be possible now."""
    if record is None or not record.finished or (record.status == "skipped" and planned.problem is None):
        return None
    return record


def key(configuration: Mapping[str, Any]) -> str:
    """The configuration of a point, to be looked up by."""
    return repr(sorted(configuration.items()))
