"""A sweep: every point not finished yet, then table, figure and summary of all."""

from __future__ import annotations

import random
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console

from atra.records import Record, read_record, write_record
from experiments.configuration import Configuration, make_results_folder
from experiments.figures import write_figure
from experiments.launch import run_worker
from experiments.measuring import Runner, current_environment, identity, measure
from experiments.points import PlannedPoint, plan_points
from experiments.progress import SweepProgress
from experiments.summary import print_sweep, results_console, say_outcome
from experiments.table import make_table, write_table


def run_sweep(configurations: Sequence[Configuration], run: Runner = run_worker) -> pd.DataFrame:
    """Measure the points of a sweep and write everything below `<results_dir>/<sweep.name>/`.

    Finished points (measured before, on a machine and software like this) are taken from their records; the order of
    the others is shuffled by `sweep.shuffle_seed`. The table has one row a point, scene by scene, and holds this
    sweep's points only. An interrupt stops the running worker, and table and figure are made of what is done.
    Returns the table. Raises InputError before any work; SystemExit(130) after an interrupt, SystemExit(1) if points
    failed.
    """
    first = configurations[0]
    environment = current_environment()
    planned = {identity(one.point, environment): one for one in plan_points(configurations)}
    folder = make_results_folder(first)
    records_folder = folder / "records"
    console = Console(stderr=True)
    records: dict[str, Record] = {}
    finished = impossible = 0
    for point_identity, one in planned.items():
        earlier = _read_earlier(records_folder, point_identity, console)
        if earlier is not None and earlier.finished:
            records[point_identity] = earlier
            finished += 1
        elif one.problem is not None:
            records[point_identity] = measure(one)
            write_record(records_folder, records[point_identity])
            impossible += 1
    to_do = [point_identity for point_identity in planned if point_identity not in records]
    random.Random(first.sweep.shuffle_seed).shuffle(to_do)

    console.print(
        f"{len(planned)} points: {finished} finished before, {impossible} cannot be measured, {len(to_do)} to do; "
        f"results in {folder}",
        markup=False, highlight=False, soft_wrap=True,
    )  # fmt: skip
    interrupted = False
    try:
        with SweepProgress(len(to_do), console) as progress:
            for point_identity in to_do:
                one = planned[point_identity]
                progress.begin(one.point.label())
                record = measure(one, run)
                write_record(records_folder, record)
                records[point_identity] = record
                progress.end(one.point.label(), say_outcome(record))
    except KeyboardInterrupt:
        interrupted = True

    table = make_table(_in_order(planned, records))
    write_table(folder, table)
    write_figure(folder, first.sweep.figure, table)
    print_sweep(table, folder, results_console())
    if interrupted:
        left = len(planned) - len(records)
        print(f"run.py: interrupted; {left} points left, the same command goes on from here", file=sys.stderr)
        raise SystemExit(130)
    failed = int((table["status"] == "failed").sum())
    if failed:
        print(f"run.py: {failed} points failed; the same command tries them again", file=sys.stderr)
        raise SystemExit(1)
    return table


def _read_earlier(folder: Path, point_identity: str, console: Console) -> Record | None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        earlier = read_record(folder, point_identity)
    for warning in caught:
        console.print(f"warning: {warning.message}", markup=False, highlight=False, soft_wrap=True)
    return earlier


def _in_order(planned: dict[str, PlannedPoint], records: dict[str, Record]) -> list[Record]:
    """Scenes in the order given, each with rising splits."""
    scenes = list(dict.fromkeys(one.point.scene for one in planned.values()))
    done = [name for name in planned if name in records]

    def rank(name: str) -> tuple[int, bool, int, int]:
        point = planned[name].point
        return scenes.index(point.scene), point.culling, point.split_y, point.split_x

    return [records[name] for name in sorted(done, key=rank)]
