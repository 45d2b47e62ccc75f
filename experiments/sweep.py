"""A sweep: every point not finished yet, then table, figures and summary of all."""

from __future__ import annotations

import random
import sys
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import groupby
from pathlib import Path

import pandas as pd
from rich.console import Console

from experiments.commands.program import PROGRAM
from experiments.harness.configuration import Configuration, records_folder
from experiments.harness.points import GridPoint, PlannedPoint, Runner, in_order, measure, plan_sweep
from experiments.harness.processes.idle import Waiting
from experiments.harness.processes.launching import run_worker
from experiments.harness.progress import SweepProgress, say, say_roughly
from experiments.harness.records import Record, check_writable, exclusive, read_record, write_record
from experiments.launched import Launch, finished_elsewhere, is_reusable, measure_elsewhere
from experiments.report.writing import check_figures, choose_folder, tell_whose_tables_are_replaced, write_results
from experiments.results.processes import WHY, as_replacement, to_replace
from experiments.results.table import Tables, make_tables
from experiments.results.terminal import print_sweep, results_console, say_label, say_outcome, say_problems
from experiments.results.time_warnings import was_idle

_PROCESS_S = 3.0
"""Seconds that a process is expected to take before any is measured: its start and some frames of a million pixels."""


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
    process before any has its second, in an order shuffled by `sweep.shuffle_seed`. Measured here, table and figures
    are written after each such pass. Processes in which the machine was not as it mostly was are replaced by new ones
    in the end, each `sweep.repeats` times at most. The table has one row a point, scene by scene, and holds this
    sweep's points only. An interrupt stops the running worker, and table and figures are made of what is done.
    command: what the user ran, for the report. launch: where the points are measured, None = here, one by one;
    at_once: how many processes it is given at a time.
    Returns the table. Raises InputError before any work; SystemExit(130) after an interrupt, SystemExit(1) if points
    failed or an image is wrong.
    """
    console = Console(stderr=True)
    first = grid_points[0].configuration
    check_figures(first.sweep.figures, tuple(dict.fromkeys(grid_point.grid for grid_point in grid_points)))
    points = plan_sweep(grid_points, console)
    folder, records = choose_folder(first, points, command, console), records_folder(first)
    check_writable(folder)
    check_writable(records)
    waiting = Waiting(first.measure.idle_limit_s, partial(say, console))
    sweep = _Sweep(points, records, console, run or run_worker, waiting, launch, at_once)
    with exclusive(records.parent, records, folder):
        to_do = sweep.begin(folder, first.sweep.shuffle_seed)
        passes = sweep.passes(to_do)
        sweep.say_what_is_ahead(passes, first.sweep.repeats)
        interrupted = False
        try:
            for number in sweep.measure_passes(passes):
                _write_so_far(sweep, first, command, number)
            sweep.measure_again(first.sweep.repeats)
        except KeyboardInterrupt:
            interrupted = True
        return _finish(sweep, first, folder, command, interrupted)


def _write_so_far(sweep: _Sweep, first: Configuration, command: str, processes: int) -> None:
    """Table and figures of the passes that are done; claims and page wait for the end, as they need every process."""
    so_far = replace(first, sweep=replace(first.sweep, report=False))
    open_first = write_results(so_far, sweep.tables(), command)
    if open_first is not None:
        each = "one process" if processes == 1 else f"{processes} processes"
        say(sweep.console, f"figure so far, {each} a point: {open_first}")


def _finish(sweep: _Sweep, first: Configuration, folder: Path, command: str, interrupted: bool) -> pd.DataFrame:
    tables = sweep.tables()
    open_first = write_results(first, tables, command)
    print_sweep(tables, folder, results_console())
    if open_first is not None:
        say(results_console(), open_first)
    left = len(sweep.points) - len(sweep.done)
    problem = say_problems(tables.points, sweep.done.values(), left)
    if interrupted:
        problem = f"interrupted; {left} points left, the same command goes on from here"
    if problem is not None:
        print(f"{PROGRAM}: {problem}", file=sys.stderr)
        raise SystemExit(130 if interrupted else 1)
    return tables.points


@dataclass
class _Sweep:
    """Points of a sweep by identity. folder: of the records. run, launch, at_once: of `run_sweep`. waiting: waits for
    an idle machine. done: the records so far, by identity. is_idle: whether the machine was so of late."""

    points: dict[str, PlannedPoint]
    folder: Path
    console: Console
    run: Runner
    waiting: Waiting
    launch: Launch | None
    at_once: int
    done: dict[str, Record] = field(default_factory=dict)
    is_idle: bool = False

    def tables(self) -> Tables:
        """The tables of the processes that are done."""
        names = in_order(self.points, self.done)
        grids = {self.done[name].point_id: self.points[name].grids for name in names}
        return make_tables([self.done[name] for name in names], grids)

    def begin(self, results: Path, shuffle_seed: int) -> list[str]:
        """Take over what was finished before, record what cannot be measured, and return what is left to do."""
        self.done = self._finished() if self.launch is None else finished_elsewhere(self.folder, self.points)
        finished = len(self.done)
        for name, planned in self.points.items():
            if name not in self.done and planned.problem is not None:
                self._keep(name, measure(planned))
        to_do = [name for name in self.points if name not in self.done]
        random.Random(shuffle_seed).shuffle(to_do)
        to_do.sort(key=lambda name: self.points[name].point.process)
        of_points = sum(planned.point.process == 0 for planned in self.points.values())
        say(
            self.console,
            f"{of_points} points in {len(self.points)} processes: {finished} finished before, "
            f"{len(self.done) - finished} cannot be measured, {len(to_do)} to do; results in {results}",
        )
        if to_do and self.launch is None:  # jobs elsewhere leave tables of other machines
            tell_whose_tables_are_replaced(results, self.folder, self.console)
        return to_do

    def _finished(self) -> dict[str, Record]:
        """Records that an earlier run finished on a machine and with software like this."""
        found = {}
        for name, planned in self.points.items():
            record = read_record(self.folder, name, lambda text: say(self.console, f"warning: {text}"))
            if record is not None and is_reusable(record, planned):
                found[name] = record
        return found

    def passes(self, names: Sequence[str]) -> list[list[str]]:
        """The processes to do, the first of every point before the second of any. A launcher gets all in one pass, as
        it need not wait for the end of one before the next."""
        if self.launch is not None:
            return [list(names)] if names else []
        return [list(of_pass) for _, of_pass in groupby(names, lambda name: self.points[name].point.process)]

    def say_what_is_ahead(self, passes: Sequence[Sequence[str]], repeats: int) -> None:
        """One line before the first process: when there is something to see, and when all is done."""
        if self.launch is not None or not passes:
            return
        first, every = _PROCESS_S * len(passes[0]), _PROCESS_S * sum(map(len, passes))
        words = [f"first look in about {say_roughly(first)}"] if len(passes) > 1 else []
        words.append(f"all in about {say_roughly(every)} at {_PROCESS_S:g} s a process")
        repeated = f"; up to {repeats} repeat{'s' * (repeats != 1)} if disturbed" if repeats else ""
        say(self.console, f"{', '.join(words)}{repeated}; Ctrl-C keeps all")

    def measure_passes(self, passes: Sequence[Sequence[str]]) -> Iterator[int]:
        """Measure pass by pass. Yields the number of processes that each point has had after each pass but the last."""
        with SweepProgress(sum(map(len, passes)), self.console) as progress:
            for number, names in enumerate(passes, 1):
                is_first_look = number == 1 and len(passes) > 1
                if is_first_look and self.waiting.tell_who_disturbs():
                    self.is_idle = True
                self._measure(names, progress, waits=not is_first_look)
                if number < len(passes):
                    yield self.points[names[0]].point.process + 1

    def measure_again(self, repeats: int) -> None:
        """Replace processes that strayed or were disturbed by new ones, `repeats` times at most; a record stays until
        its successor is there."""
        failed: set[str] = set()
        for number in range(1, repeats + 1):
            names = [name for name in to_replace(self.done, repeats) if name not in failed]
            if not names:
                break
            told = f"measured again, repeat {number} of at most {repeats}: {WHY}; Ctrl-C keeps all"
            say(self.console, f"{_processes(names, 'is', 'are')} {told}")
            before = dict(self.done)
            with SweepProgress(len(names), self.console) as progress:
                self._measure(names, progress)
            failed.update(name for name in names if self.done[name] is before[name])  # its job left no record
        left = to_replace(self.done)
        if left:
            labels = "; ".join(dict.fromkeys(say_label(self.points[name].point) for name in left))
            say(self.console, f"{_processes(left, 'remains', 'remain')} disturbed, of these points: {labels}")

    def _measure(self, names: Sequence[str], progress: SweepProgress, waits: bool = True) -> None:
        """Measure processes; an interrupt leaves those that are done. waits: for an idle machine."""
        if self.launch is None:
            measured = self._measure_here(names, progress, waits)
        else:
            progress.begin("jobs elsewhere")
            measured = measure_elsewhere(self.launch, self.at_once, self.folder, self.points, names)
        for name, record, problem in measured:
            if record is not None:
                self._keep(name, record)
            told = f"no record: {problem}" if record is None else say_outcome(self.done[name], self.folder)
            progress.end(say_label(self.points[name].point), told)

    def _measure_here(
        self, names: Sequence[str], progress: SweepProgress, waits: bool
    ) -> Iterator[tuple[str, Record | None, str | None]]:
        """Process by process, as `measure_elsewhere`."""
        for name in names:
            point = self.points[name].point
            progress.begin(say_label(point))
            if waits and point.workload.is_timed and not self.is_idle:
                self.waiting.for_idle()
            record = measure(self.points[name], self.run)
            self.is_idle = was_idle(record)
            yield name, record, None

    def _keep(self, name: str, record: Record) -> None:
        """Write a record, over that which it replaces."""
        earlier = self.done.get(name)
        kept = record if earlier is None else as_replacement(record, earlier)
        write_record(self.folder, kept)
        self.done[name] = kept


def _processes(some: Collection[str], singular: str, plural: str) -> str:
    """How many processes, with the verb that follows."""
    return f"1 process {singular}" if len(some) == 1 else f"{len(some)} processes {plural}"
