"""What a sweep leaves in its folder: table, figures and, if asked for, claims and the HTML report."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from rich.console import Console

from atra.errors import InputError, RecordError, StorageError
from atra.files.paths import write_together
from experiments.drawing.figure import FigureKind, NamedFigure, make_figures
from experiments.drawing.render import figure_files
from experiments.harness.configuration import Configuration, records_folder, results_folder
from experiments.harness.environment import describe_difference
from experiments.harness.identity import code_sha256, current_environment, is_current
from experiments.harness.progress import say
from experiments.harness.records import LIMITS, exclusive, load_record
from experiments.methods import find_method
from experiments.paper.claims import judge_claims
from experiments.paper.figures import FIGURES as PAPER_FIGURES
from experiments.report.page import ReportContents, render_report
from experiments.results.claims import claim_files, judge_all
from experiments.results.processes import check_one_environment
from experiments.results.table import (
    Tables,
    make_tables,
    read_tables,
    rows_of,
    table_files,
    workload_rows,
)
from experiments.workloads import WORKLOADS
from experiments.workloads.picture.files import read_pictures
from experiments.workloads.series import of_files

GRID_OF_FILES = "method_file"
"""The grid of the methods of files that a sweep measures beside its own; every figure of it draws them, too."""

_PAGE, _COMMAND_FILE = "report.html", "command.txt"
"""The latter keeps what the user ran, for a report written later."""

_TOLD_BY_TABLES = (
    "cpu", "cpu_extensions", "affinity", "git_commit", "embree_version", "numba_version", "python_version",
)  # fmt: skip
"""Columns that tell of the environment, where all points have it alike."""

_FORMER = (
    r"(break_even|figure3_differences|threads|growth|moving|agreement|stereo|multiframe|rates|peers|rays_\w+)\.(svg|png)",
    r"disagreements(\.csv|_.+\.png)",
)
"""Files that earlier versions drew and listed."""


def choose_folder(configuration: Configuration, points: Collection[str], command: str, console: Console) -> Path:
    """The sweep's folder: that of its name, or where that holds another sweep's table, one with a number behind the
    name, which `configuration.sweep.name` then has, too.

    points: identities of all that the sweep measures. A table is this sweep's if the same command made it, with
    whatever limits, or if it holds none but these.
    """
    name = configuration.sweep.name
    for number in count(2):
        folder = results_folder(configuration)
        tables = _readable_tables(folder, console)
        if tables is None or _is_same(_command_of(folder), command) or set(tables.points["point_id"]) <= set(points):
            return folder
        configuration.sweep.name = f"{name}_{number}"
        say(
            console,
            f"{folder} holds the table of `{_command_of(folder)}`, which stays; this sweep goes to "
            f"{results_folder(configuration)}, unless sweep.name=... says otherwise",
        )
    raise AssertionError("numbers do not end")


def write_results(configuration: Configuration, tables: Tables, command: str) -> str | None:
    """Write tables, figures and, where the sweep asks for it, claims and page into its folder: all of them, or none
    where the disk lacks room. What was made of an earlier table and is not made of this one is removed. A sweep may
    call it as often as it has more to show.

    Returns what to open first, with its path: the page, or else the first figure; None where there is neither.
    """
    folder, report = results_folder(configuration), configuration.sweep.report
    figures, files = _what_follows(configuration, tables, command=command, report=report)
    _write(folder, files, {**table_files(tables), _COMMAND_FILE: f"{command}\n".encode()})
    if report:
        return f"report: {folder / _PAGE}"
    first = most_telling(figures, tables.points)
    return f"{first.caption}: {folder / first.name}.png" if first else None


def most_telling(figures: Sequence[NamedFigure], table: pd.DataFrame) -> NamedFigure | None:
    """The first figure that names all methods of files in the table, if there are any; or else the first."""
    labels = [find_method(name).label for name in of_files(table)["method"].unique()]
    named = [
        figure
        for figure in figures
        if all(re.search(rf"\b{re.escape(label)}\b", figure.figure.words) for label in labels)
    ]
    return next(iter([*named, *figures]), None)


def run_report(configuration: Configuration) -> None:
    """`rewrite_report`, which says where the page is."""
    print(f"report: {rewrite_report(configuration)}")


def rewrite_report(configuration: Configuration) -> Path:
    """`python run.py report`: figures, claims and page of a sweep again, from its table and records; measures nothing.

    Without a table every claim is "not measured". Returns the page. Raises InputError if no such sweep was run, if the
    folder is in use, or if its points are of two machines or versions, and RecordError if one of its records cannot be
    used: nothing can be measured again here.
    """
    folder = results_folder(configuration)
    if not folder.is_dir():
        name = configuration.sweep.name
        raise InputError(f"{folder} does not exist, so there is nothing to report; run sweep={name} first")
    check_figures(configuration.sweep.figures, configuration.sweep.grids)
    with exclusive(folder.parent, folder):
        tables = read_tables(folder) or make_tables([])
        _, files = _what_follows(configuration, tables, command=_command_of(folder), report=True)
        _write(folder, files)
        return folder / _PAGE


def _command_of(folder: Path) -> str:
    """What the user ran, "" where nobody knows."""
    path = folder / _COMMAND_FILE
    return path.read_text(encoding="utf-8").strip() if path.exists() else ""


def _is_same(command: str, other: str) -> bool:
    """Whether two commands are one but for limits, which one raises to get the points that they stopped."""
    limits = tuple(f"measure.{name}=" for name in LIMITS)
    first, second = ([word for word in line.split() if not word.startswith(limits)] for line in (command, other))
    return first == second


def _write(folder: Path, files: Mapping[str, bytes], tables: Mapping[str, bytes] | None = None) -> None:
    """Write what follows from the tables, and these where they are new, and remove what followed from earlier ones."""
    write_together({folder / name: content for name, content in {**(tables or {}), **files}.items()})
    for path in _files_of_tables(folder):
        if path.relative_to(folder).as_posix() not in files:
            path.unlink(missing_ok=True)


def _files_of_tables(folder: Path) -> list[Path]:
    """The files in the folder that some table was made into: figures, claims, page, and FILES of the workloads."""
    shown: list[Any] = [workload.part("shown") for workload in WORKLOADS]
    patterns = [re.escape(_PAGE), *_FORMER, *(kind.file_names for kind in figure_kinds())]
    patterns += [pattern for part in shown for pattern in getattr(part, "FILES", ())]
    is_one = re.compile("|".join(f"(?:{pattern})" for pattern in patterns)).fullmatch
    claims = ["claims", *(part.CLAIMS_FILE for part in shown if hasattr(part, "CLAIMS"))]
    judged = [folder / f"{name}{end}" for name in claims for end in (".json", ".csv")]
    return [path for path in (*folder.iterdir(), *judged) if path.is_file() and (path in judged or is_one(path.name))]


def _what_follows(
    configuration: Configuration, tables: Tables, *, command: str, report: bool
) -> tuple[list[NamedFigure], dict[str, bytes]]:
    """The figures, and the contents of the files of figures, claims and page by name, all from tables and records."""
    folder, records, table = results_folder(configuration), records_folder(configuration), tables.points
    environment = _environment(table, records)
    figures = list(figures_of(table, folder, configuration.sweep.figures))
    files = {name: content for figure in figures for name, content in figure_files(figure).items()}
    for workload in WORKLOADS:
        shown: Any = workload.part("shown")
        rows = workload_rows(table, workload.name)
        if len(rows):
            if hasattr(shown, "CLAIMS"):
                processes = workload_rows(tables.processes, workload.name)
                files |= claim_files(judge_all(shown.CLAIMS, processes), shown.CLAIMS_FILE)
            if hasattr(shown, "write"):
                files |= _written(shown.write, records, rows)
    if report:
        claims = judge_claims(tables.processes)
        files |= claim_files(claims)
        contents = ReportContents(
            title=f"atra: {folder.name}",
            command=command,
            table=table,
            processes=tables.processes,
            # The pictures have a section of their own, and some must not be passed on.
            figures=[figure for figure in figures if figure.in_page],
            pictures=read_pictures(table, folder),
            claims=claims,
            environment=environment,
        )
        files[_PAGE] = render_report(contents).encode()
    return figures, files


def _written(write: Callable[..., object], records: Path, rows: pd.DataFrame) -> dict[str, bytes]:
    """The contents of what a workload writes into a folder, by name. Raises StorageError."""
    try:
        with TemporaryDirectory() as place:
            write(Path(place), records, rows)
            paths = [path for path in Path(place).rglob("*") if path.is_file()]
            return {path.relative_to(place).as_posix(): path.read_bytes() for path in paths}
    except OSError as error:
        raise StorageError(f"no results can be made: {error}; TMPDIR names a folder with more room") from None


def _environment(table: pd.DataFrame, records: Path) -> dict[str, Any]:
    """The one machine and software of all points of the table; without records, what the table tells of it.

    Raises InputError if there are two, and RecordError for a record that cannot be used.
    """
    measured = table[~table["status"].isin(["skipped", "failed"])]
    table = measured if len(measured) else table
    cpus = sorted(set(table["cpu"].dropna()))
    if len(cpus) > 1:
        raise InputError(f"the table holds points of {' and of '.join(cpus)}; run the sweep again on one machine")
    records_found = [record for name in table["point_id"] if (record := load_record(records, name)) is not None]
    check_one_environment(records_found)
    if records_found:
        return records_found[0].environment
    known = {name: table[name].dropna().unique() for name in _TOLD_BY_TABLES if name in table}
    return {name: values[0] for name, values in known.items() if len(values) == 1}


def tell_whose_tables_are_replaced(folder: Path, records: Path, console: Console) -> None:
    """Say so if the sweep's earlier table is of another machine or version, which is why points are measured again."""
    tables = _readable_tables(folder, console)
    for point_identity in [] if tables is None else tables.points["point_id"]:
        try:
            record = load_record(records, point_identity)
        except RecordError:
            continue
        if record is not None:
            difference = describe_difference(record.environment, current_environment())
            if difference is None and not is_current(record):
                before, now = record.environment.get("code_sha256"), code_sha256(record.files)
                difference = f"code_sha256 is {before!r} in one and {now!r} in the other"
            if difference is not None:
                say(
                    console,
                    f"the table in {folder} is of another machine or version ({difference}, which is this one); its "
                    "points are measured again and it is replaced",
                )
            return


def _readable_tables(folder: Path, console: Console) -> Tables | None:
    try:
        return read_tables(folder)
    except InputError as error:
        say(console, f"warning: {error}")
        return None


def figure_kinds() -> tuple[FigureKind, ...]:
    """Those of every workload, and the paper's that draw several workloads."""
    shown = (workload.part("shown") for workload in WORKLOADS)
    return (*(kind for part in shown for kind in getattr(part, "FIGURES", ())), *PAPER_FIGURES)


def check_figures(figures: Mapping[str, Sequence[str]], grids: Collection[str]) -> None:
    """Raise InputError, naming those there are, for a figure that is unknown or drawn of a grid the sweep lacks."""
    known = [kind.name for kind in figure_kinds()]
    for name, drawn in figures.items():
        if name not in known:
            raise InputError(f"sweep.figures names {name!r}, expected one of {', '.join(known)}")
        for grid in drawn:
            if grid not in grids:
                raise InputError(f"sweep.figures.{name} names {grid!r}, expected one of {', '.join(grids)}")


def figures_of(
    table: pd.DataFrame, folder: Path, grids: Mapping[str, Sequence[str]] | None = None
) -> Iterator[NamedFigure]:
    """Every figure that the table allows; one none of whose points was measured is left out.

    folder: of the sweep. grids: by name of the figure, the grids whose points it draws; without any,
    every figure draws what it can of the table.
    """
    for kind in figure_kinds():
        if grids and kind.name not in grids:
            continue
        rows = _of_grids(table, (*grids[kind.name], GRID_OF_FILES)) if grids else kind.rows(table)
        if len(rows):
            yield from make_figures(kind, rows, folder)


def _of_grids(table: pd.DataFrame, grids: Sequence[str]) -> pd.DataFrame:
    """The rows of these grids, in the columns of their workloads."""
    rows = rows_of(table, *grids)
    return workload_rows(rows, *rows["workload"].unique())
