"""A sweep: every point not finished yet, then table, figures and summary of all."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from atra.errors import MemoryBudgetError, RecordError
from experiments.commands.program import PROGRAM
from experiments.harness.configuration import Configuration, check_writable, records_folder
from experiments.harness.identity import Runner, code_sha256, current_environment, identity, identity_of, measure
from experiments.harness.lock import exclusive
from experiments.harness.options import plain_options
from experiments.harness.point import Point
from experiments.harness.points import PlannedPoint, plan_points
from experiments.harness.processes.launching import run_worker
from experiments.harness.progress import SweepProgress, say
from experiments.harness.records import Record, load_record, read_record, record_path, write_record
from experiments.report.figures import check_figures
from experiments.report.writing import choose_folder, tell_whose_tables_are_replaced, write_results
from experiments.results.canary import BAND, strays
from experiments.results.table import make_tables
from experiments.results.terminal import print_sweep, results_console, say_label, say_outcome
from scenes.loading import replace_missing_scenes


@dataclass(frozen=True)
class GridPoint:
    """configuration: one point of the grid called `grid`. overrides: what composes it, as on the command line."""

    grid: str
    configuration: Configuration
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class SweepPoint:
    """A point of a sweep in one of its processes, the grids it is part of, and what composes it."""

    planned: PlannedPoint
    grids: tuple[str, ...]
    overrides: tuple[str, ...]


_LAST = ("packet_width", "culling", "frames", "split_y", "split_x")
"""Settings by which the rows of a method are ordered last, as numbers."""

Launch = Callable[[Sequence[Sequence[str]]], Sequence[str | None]]
"""Measures points elsewhere, each given by its overrides. When it returns, their records are in the records folder; it
returns for each point why its job failed, None = it did not."""


def run_sweep(
    grid_points: Sequence[GridPoint],
    *,
    command: str = "",
    run: Runner = run_worker,
    launch: Launch | None = None,
    at_once: int = 1,
) -> pd.DataFrame:
    """Measure the points of a sweep and write everything below `<results_dir>/<sweep.name>/`.

    Timed points are measured in `measure.processes` processes each. Finished ones (measured before, by this or another
    sweep, on a machine and software like this) are taken from their records; of the others each point has its first
    process before any has its second, in an order shuffled by `sweep.shuffle_seed`. Those in which the machine was not
    as it mostly was are measured once more in the end. The table has one row a point, scene by scene, and holds this
    sweep's points only. An interrupt stops the running worker, and table and figures are made of what is done.
    command: what the user ran, for the report. launch: where the points are measured, None = here, one by one;
    at_once: how many it is given at a time.
    Returns the table. Raises InputError before any work; SystemExit(130) after an interrupt, SystemExit(1) if points
    failed.
    """
    console = Console(stderr=True)
    first = grid_points[0].configuration
    check_figures(first.sweep.figures, tuple(dict.fromkeys(one.grid for one in grid_points)))
    points = _plan(grid_points, console)
    folder, records = choose_folder(first, points, command, console), records_folder(first)
    check_writable(folder)
    check_writable(records)
    with exclusive(Path(first.results_dir), records, folder):
        return _run(
            points, first, folder, records, command=command, run=run, launch=launch, at_once=at_once, console=console
        )


def _run(
    points: dict[str, SweepPoint],
    first: Configuration,
    folder: Path,
    records: Path,
    *,
    command: str,
    run: Runner,
    launch: Launch | None,
    at_once: int,
    console: Console,
) -> pd.DataFrame:
    done: dict[str, Record] = {}
    finished = impossible = 0
    warn = _warn_on(console)
    for point_identity, one in points.items():
        earlier = read_record(records, point_identity, warn)
        if earlier is not None and earlier.finished:
            done[point_identity] = earlier
            finished += 1
        elif one.planned.problem is not None:
            done[point_identity] = measure(one.planned)
            write_record(records, done[point_identity])
            impossible += 1
    to_do = [point_identity for point_identity in points if point_identity not in done]
    random.Random(first.sweep.shuffle_seed).shuffle(to_do)
    to_do.sort(key=lambda name: points[name].planned.point.process)

    of_points = sum(one.planned.point.process == 0 for one in points.values())
    say(
        console,
        f"{of_points} points in {len(points)} processes: {finished} finished before, {impossible} cannot be measured, "
        f"{len(to_do)} to do; results in {folder}",
    )
    if to_do:
        by_configuration = {_key(one.planned.point.configuration()): one.planned.point for one in points.values()}

        def code(record: Record) -> str | None:
            point = by_configuration.get(_key(record.configuration))
            return None if point is None else code_sha256(point)

        tell_whose_tables_are_replaced(folder, records, console, code)

    def measure_all(names: Sequence[str]) -> None:
        if launch is None:
            _measure_here({name: points[name].planned for name in names}, records, done, run, console)
        else:
            _measure_elsewhere({name: points[name] for name in names}, records, done, launch, at_once, console)

    interrupted = False
    try:
        measure_all(to_do)
        _measure_again(records, done, measure_all, console)
    except KeyboardInterrupt:
        interrupted = True

    names = _in_order(points, done)
    tables = make_tables([done[name] for name in names], {done[name].point_id: points[name].grids for name in names})
    table = tables.points
    open_first = write_results(first, tables, command)
    print_sweep(tables, folder, results_console())
    if open_first is not None:
        say(results_console(), open_first)
    left = len(points) - len(done)
    if interrupted:
        print(f"{PROGRAM}: interrupted; {left} points left, the same command goes on from here", file=sys.stderr)
        raise SystemExit(130)
    failed = int((table["status"] == "failed").sum())
    if failed or left:
        what = ", ".join([f"{failed} points failed"] * bool(failed) + [f"{left} points have no record"] * bool(left))
        print(f"{PROGRAM}: {what}; the same command tries them again", file=sys.stderr)
        raise SystemExit(1)
    return table


def _measure_again(
    folder: Path, done: dict[str, Record], measure_all: Callable[[Sequence[str]], None], console: Console
) -> None:
    """Measure once more, at the end, what the machine was out of its usual state for (`experiments.results.canary`)."""
    out = strays(list(done.values()))
    names = [name for name, one in done.items() if one.point_id in out and not one.results.get("measured_again")]
    if not names:
        return
    say(console, f"{len(names)} processes are measured again: rtcIntersect1 over packets strayed by over {BAND:.0%}")
    for name in names:
        record_path(folder, name).unlink(missing_ok=True)  # a job that finds a record does not measure
    measure_all(names)
    for name in names:
        done[name] = replace(done[name], results=done[name].results | {"measured_again": True})
        write_record(folder, done[name])


def measure_launched(configuration: Configuration) -> None:
    """Measure one point of a launched sweep and leave its record in the records folder, unless it is there already."""
    if configuration.sweep.stand_ins:
        replace_missing_scenes([configuration.scene])
    (planned,) = plan_points([configuration])
    folder = records_folder(configuration)
    check_writable(folder)
    earlier = read_record(folder, identity(planned.point, current_environment()))
    if earlier is None or not earlier.finished:
        write_record(folder, measure(planned))


def _plan(grid_points: Sequence[GridPoint], console: Console) -> dict[str, SweepPoint]:
    """Points by identity, each once."""
    configurations = [one.configuration for one in grid_points]
    if configurations[0].sweep.stand_ins:
        for note in replace_missing_scenes([configuration.scene for configuration in configurations]):
            say(console, note)
    environment = current_environment()
    points: dict[str, SweepPoint] = {}
    for grid_point, planned in zip(grid_points, plan_points(configurations), strict=True):
        point_identity = identity(planned.point, environment)
        before = points[point_identity].grids if point_identity in points else ()
        grids = tuple(dict.fromkeys([*before, grid_point.grid]))
        # One that lacks memory now may have been measured when there was more.
        possible = planned.problem is None or isinstance(planned.problem, MemoryBudgetError)
        repeated = possible and planned.point.workload.is_timed
        for process in range(grid_point.configuration.measure.processes if repeated else 1):
            of_process = replace(planned, point=replace(planned.point, process=process))
            overrides = (*grid_point.overrides, *(() if process == 0 else (f"measure.process={process}",)))
            points[identity(of_process.point, environment)] = SweepPoint(of_process, grids, overrides)
    return points


def _measure_here(
    to_do: dict[str, PlannedPoint], folder: Path, done: dict[str, Record], run: Runner, console: Console
) -> None:
    with SweepProgress(len(to_do), console) as progress:
        for point_identity, planned in to_do.items():
            progress.begin(say_label(planned.point))
            record = measure(planned, run)
            write_record(folder, record)
            done[point_identity] = record
            kind = f"{planned.point.workload.name} {planned.point.method.name}"
            progress.end(say_label(planned.point), say_outcome(record), kind)


def _measure_elsewhere(
    to_do: dict[str, SweepPoint],
    folder: Path,
    done: dict[str, Record],
    launch: Launch,
    at_once: int,
    console: Console,
) -> None:
    names = list(to_do)
    with SweepProgress(len(names), console) as progress:
        for start in range(0, len(names), at_once):
            batch = names[start : start + at_once]
            labels = [say_label(to_do[name].planned.point) for name in batch]
            progress.begin(labels[0] if len(batch) == 1 else f"{labels[0]} and {len(batch) - 1} more")
            try:
                problems = launch([to_do[name].overrides for name in batch])
            finally:  # an interrupt, too, leaves records of the batch
                found = _launched_records({name: to_do[name].planned.point for name in batch}, folder, console)
                done |= found
            for name, label, problem in zip(batch, labels, problems, strict=True):
                told = (
                    say_outcome(found[name]) if name in found else f"no record: {problem or 'its job left none to use'}"
                )
                progress.end(label, told)


def _launched_records(to_do: dict[str, Point], folder: Path, console: Console) -> dict[str, Record]:
    """The records of launched points, by this machine's identity of the point.

    Another machine wrote them under an identity of its own, so they are known by their configuration; those of other
    code, whose numbers are no longer true, are not. make_table refuses if they are of several machines.
    """
    environment, warn = current_environment(), _warn_on(console)
    own = {name: read_record(folder, identity(point, environment), warn) for name, point in to_do.items()}
    if all(record is not None for record in own.values()):
        return {name: record for name, record in own.items() if record is not None}
    by_configuration: dict[str, Record] = {}
    wanted = {_key(point.configuration()): point for point in to_do.values()}
    for path in sorted(folder.glob("*.json"), key=lambda path: path.stat().st_mtime):
        try:
            record = load_record(folder, path.stem)
        except RecordError:  # perhaps of another sweep or version, and not ours to set aside
            continue
        point = None if record is None else wanted.get(_key(record.configuration))
        if record is not None and point is not None and record.point_id == identity_of(record, point):
            by_configuration[_key(record.configuration)] = record
    found = {name: by_configuration.get(_key(point.configuration())) for name, point in to_do.items()}
    return {name: record for name, record in found.items() if record is not None}


def _key(configuration: Mapping[str, Any]) -> str:
    """The configuration of a point, to be looked up by."""
    return repr(sorted(configuration.items()))


def _warn_on(console: Console) -> Callable[[str], None]:
    return lambda text: say(console, f"warning: {text}")


def _in_order(points: dict[str, SweepPoint], done: dict[str, Record]) -> list[str]:
    """Identities of the points done: scenes in the order given, each by what was measured, with rising settings."""
    scenes = list(dict.fromkeys(one.planned.point.scene for one in points.values()))
    workloads = list(dict.fromkeys(one.planned.point.workload.name for one in points.values()))

    def rank(name: str) -> tuple[Any, ...]:
        point = points[name].planned.point
        options = {**plain_options(point.workload_options), **plain_options(point.options)}
        # Splits rise last; what is left open comes before any value.
        others = sorted((key, (value is not None, str(value))) for key, value in options.items() if key not in _LAST)
        splits = [options.get(key) or 0 for key in _LAST]
        return scenes.index(point.scene), workloads.index(point.workload.name), point.method.name, others, splits

    return sorted((name for name in points if name in done), key=rank)
