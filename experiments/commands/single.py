"""`python run.py`: measure one point and print it."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console

from atra.errors import InputError, printable
from experiments.commands.program import PROGRAM
from experiments.harness.configuration import Configuration, records_folder
from experiments.harness.identity import is_current
from experiments.harness.points import measure, plan_points
from experiments.harness.progress import SweepProgress
from experiments.harness.records import Record, check_writable, exclusive, read_record, record_path, write_record
from experiments.results.table import make_table
from experiments.results.terminal import print_point, results_console, say_label, say_outcome
from experiments.workloads.images import say_wrong_image

_SINGLES = "singles"
"""Folder beside that of the records, for points of which there is a record already."""


def run_single_point(configuration: Configuration) -> Record:
    """Measure the point (each time), write its record and files, print its table. A record that sweeps share stays as
    it is: they go on from it, and it counts the processes it has replaced.

    Raises InputError, MemoryBudgetError or EmbreeError for what cannot be measured, and SystemExit(1), with what the
    worker printed on stderr, when measuring itself went wrong, or the image is wrong.
    """
    (planned,) = plan_points([configuration])
    if planned.problem is not None:
        raise planned.problem
    folder = records_folder(configuration)
    check_writable(folder)
    with exclusive(folder.parent, folder), SweepProgress(1, Console(stderr=True)) as progress:
        progress.begin(say_label(planned.point))
        record = measure(planned)
        kept = read_record(folder, record.point_id)
        is_kept = kept is not None and kept.status == "ok" and is_current(kept)
        path = write_record(folder.with_name(_SINGLES) if is_kept else folder, record)
        progress.end(say_label(planned.point), say_outcome(record, path.parent))
    if record.status == "ok":
        print_point(make_table([record]).iloc[0], results_console())
        print(f"record: {path}")
        if is_kept:
            print(f"kept, for sweeps: {record_path(folder, record.point_id)}")
        for written in _write_files(configuration, record):
            print(f"written: {written}")
        if wrong := say_wrong_image(record.results):
            print(f"{PROGRAM}: the image is wrong: {wrong}", file=sys.stderr)
            raise SystemExit(1)
        return record
    for line in str(record.results.get("worker_output", "")).splitlines():
        print(printable(line), file=sys.stderr)
    if record.results.get("on_purpose"):
        raise InputError(str(record.error))
    print(f"{PROGRAM}: {printable(str(record.error))}; record: {path}", file=sys.stderr)
    raise SystemExit(1)


def _write_files(configuration: Configuration, record: Record) -> list[Path]:
    """What a workload makes of a point beside numbers, in a folder of its name."""
    files = configuration.workload.kind.part("files")
    return [] if files is None else files.write(Path(configuration.results_dir) / configuration.workload.name, record)
