"""A sweep: every point not finished yet, then table, figures and summary of all."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from experiments.commands.program import PROGRAM
from experiments.harness.configuration import Configuration, check_writable, records_folder
from experiments.harness.identity import Runner, code_sha256, current_environment, identity, measure
from experiments.harness.options import plain_options
from experiments.harness.point import Point
from experiments.harness.points import PlannedPoint, plan_points
from experiments.harness.processes.bytecode import bytecode_folder
from experiments.harness.processes.launching import run_worker
from experiments.harness.processes.outcome import MAY_CHANGE
from experiments.harness.processes.quiet import Waiting
from experiments.harness.progress import SweepProgress, say
from experiments.harness.records import Record, exclusive, read_record, record_path, write_record
from experiments.launched import Launch, key, measure_batch, still_true
from experiments.report.writing import check_figures, choose_folder, tell_whose_tables_are_replaced, write_results
from experiments.results.doubts import was_quiet
from experiments.results.processes import WHY, as_replacement, to_replace
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


def run_sweep(
    grid_points: Sequence[GridPoint],
    *,
    command: str = "",
    run: Runner | None = None,
    launch: Launch | None = None,
    at_once: int = 1,
) -> pd.DataFrame:
    """Measure the points of a sweep and write everything below `<results_dir>/<sweep.name>/`.

    Timed points are measured in `measure.processes` processes each. Finished ones (measured before, by this or another
    sweep, on a machine and software like this) are taken from their records; of the others each point has its first
    process before any has its second, in an order shuffled by `sweep.shuffle_seed`. Those in which the machine was not
    as it mostly was are replaced by new ones in the end. The table has one row a point, scene by scene, and holds this
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
    quiet = Waiting(first.measure.quiet_limit_s, partial(say, console), needed=first.measure.quiet_only)
    sweep = _Sweep(points, records, console, run or partial(run_worker, results=records.parent), launch, at_once, quiet)
    with exclusive(records.parent, records, folder), bytecode_folder(records.parent):
        to_do = sweep.begin(folder, first.sweep.shuffle_seed)
        interrupted = False
        try:
            sweep.measure(to_do)
            sweep.measure_again()
        except KeyboardInterrupt:
            interrupted = True
        return _finish(sweep, first, folder, command, interrupted)


def _finish(sweep: _Sweep, first: Configuration, folder: Path, command: str, interrupted: bool) -> pd.DataFrame:
    points, done = sweep.points, sweep.done
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


@dataclass
class _Sweep:
    """Points of a sweep by identity. folder: of the records. run, launch, at_once: as of `run_sweep`. quiet: waits
    for a quiet machine. done: the records so far, by identity. is_quiet: whether the machine was so of late."""

    points: dict[str, SweepPoint]
    folder: Path
    console: Console
    run: Runner
    launch: Launch | None
    at_once: int
    quiet: Waiting
    done: dict[str, Record] = field(default_factory=dict)
    is_quiet: bool = False

    def begin(self, results: Path, shuffle_seed: int) -> list[str]:
        """Take over what was finished before, record what cannot be measured, and return what is left to do."""
        finished, warn = 0, _warn_on(self.console)
        for name, one in self.points.items():
            earlier = still_true(read_record(self.folder, name, warn), one.planned)
            if earlier is not None:
                self.done[name] = earlier
                finished += 1
            elif one.planned.problem is not None:
                self._keep(name, measure(one.planned))
        to_do = [name for name in self.points if name not in self.done]
        random.Random(shuffle_seed).shuffle(to_do)
        to_do.sort(key=lambda name: self.points[name].planned.point.process)
        of_points = sum(one.planned.point.process == 0 for one in self.points.values())
        say(
            self.console,
            f"{of_points} points in {len(self.points)} processes: {finished} finished before, "
            f"{len(self.done) - finished} cannot be measured, {len(to_do)} to do; results in {results}",
        )
        if to_do:
            by_configuration = {key(point.configuration()): point for point in map(self._point, self.points)}

            def code(record: Record) -> str | None:
                point = by_configuration.get(key(record.configuration))
                return None if point is None else code_sha256(point)

            tell_whose_tables_are_replaced(results, self.folder, self.console, code)
        return to_do

    def measure(self, names: Sequence[str]) -> None:
        """Measure points; an interrupt leaves those that are done."""
        with SweepProgress(len(names), self.console) as progress:
            for start in range(0, len(names), self.at_once):
                batch = names[start : start + self.at_once]
                labels = [say_label(point) for point in map(self._point, batch)]
                progress.begin(labels[0] if len(batch) == 1 else f"{labels[0]} and {len(batch) - 1} more")
                for name, label, told in zip(batch, labels, self._measure_batch(batch), strict=True):
                    progress.end(label, told, self._kind(name))

    def measure_again(self) -> None:
        """Replace processes that strayed or were disturbed by new ones."""
        while before := {name: self.done[name] for name in to_replace(self.done)}:
            say(self.console, f"{len(before)} processes are measured again: {WHY}")
            for name in before:
                record_path(self.folder, name).unlink(missing_ok=True)  # a job that finds a record does not measure
            self.measure(list(before))
            for name, earlier in before.items():
                self._keep(name, as_replacement(self.done[name], earlier))

    def _measure_batch(self, batch: Sequence[str]) -> list[str]:
        """Measure points together; returns what came of each, in words."""
        if self.launch is None:
            for name in batch:
                if self._point(name).workload.is_timed and not self.is_quiet:
                    self.quiet.for_quiet()
                self._keep(name, measure(self.points[name].planned, self.run))
                self.is_quiet = was_quiet(self.done[name])
            return [say_outcome(self.done[name]) for name in batch]
        points = {name: self.points[name].planned.point for name in batch}
        return measure_batch(
            self.launch, points, [self.points[name].overrides for name in batch], self.folder, self.done,
            _warn_on(self.console),
        )  # fmt: skip

    def _kind(self, name: str) -> str | None:
        """What tells points apart that compile other kernels, which jobs elsewhere do out of our sight."""
        point = self._point(name)
        return f"{point.workload.name} {point.method.name}" if self.launch is None else None

    def _point(self, name: str) -> Point:
        return self.points[name].planned.point

    def _keep(self, name: str, record: Record) -> None:
        write_record(self.folder, record)
        self.done[name] = record


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
        # One that lacks memory now may have been measured when there was more, and a slow one where it was wanted.
        repeated = planned.point.workload.is_timed and isinstance(planned.problem, MAY_CHANGE)
        for process in range(grid_point.configuration.measure.processes if repeated else 1):
            of_process = replace(planned, point=replace(planned.point, process=process))
            overrides = (*grid_point.overrides, *(() if process == 0 else (f"measure.process={process}",)))
            points[identity(of_process.point, environment)] = SweepPoint(of_process, grids, overrides)
    return points


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
