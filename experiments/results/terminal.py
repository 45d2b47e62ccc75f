"""Terminal: one point, or a sweep in short."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.harness.method import Tracing
from experiments.harness.options import plain_options
from experiments.harness.point import Point
from experiments.harness.processes.worker import METHOD_LINES
from experiments.harness.progress import say
from experiments.harness.records import Record, record_path
from experiments.methods import find_method
from experiments.methods.naming import Row, best_of, say_point
from experiments.results.claims import NOT_MEASURED, Claim, judge_all
from experiments.results.settings import say_setting, settings_that_vary, without_numbers
from experiments.results.table import Tables, columns, workload_rows
from experiments.results.time_warnings import WRONG
from experiments.workloads import WORKLOADS, find_workload
from experiments.workloads.images import say_wrong_image
from experiments.workloads.tables import told_table

_PARTS = ("_low", "_high", "_half", "_rest")


def say_label(point: Point) -> str:
    """A point for progress and messages: "sponza, frame, aligned, packets of 16, 128 × 1, culling on"."""
    row = point.row
    words = [point.scene, *_say_workload(row)]
    words += [f"view {point.view}"] if point.view != "own" else []
    words.append(say_point(row))
    if point.threads != 1:
        words.append("every core" if point.threads is None else f"{point.threads} threads")
    words += [say_setting("ties", point.ties)] if point.ties != Tracing().ties else []
    return ", ".join(words)


def _say_workload(row: Row) -> list[str]:
    """The workload of a row and its options; a list is too long to tell."""
    options = plain_options(find_workload(row["workload"]).options())
    told = [name for name, default in options.items() if not isinstance(default, list)]
    return [row["workload"], *(say_setting(name, row[name]) for name in told)]


def say_outcome(record: Record, folder: Path | None = None) -> str:
    """One line on a record, for the progress display. folder: of the records; given, `failure_lines` follow."""
    if record.status != "ok":
        told = f"{record.status}: {printable(str(record.error))}"
        more = () if folder is None or record.status != "failed" else failure_lines(record, folder)
        return "\n".join([told, *more])
    told, wrong = find_workload(record.configuration["workload"]).headline(record), say_wrong_image(record.results)
    return told if wrong is None else f"{WRONG}: {wrong}; {told}"


def failure_lines(record: Record, folder: Path) -> list[str]:
    """Where in the code of another's method a point failed, and the path of its record. folder: of the records."""
    lines = [printable(line) for line in record.results.get(METHOD_LINES, ())]
    return [*lines, f"record: {record_path(folder, record.point_id)}"]


def print_point(row: pd.Series, console: Console) -> None:
    """A measured row of the table: every column of its workload that has a value, with its interval."""
    title = escape(printable(f"{row['scene']}, {row['width']} x {row['height']}: {say_point(row)}"))
    shown = Table(title=title, show_header=False, title_justify="left")
    for style in ("bold", "", "dim"):
        shown.add_column(style=style, overflow="fold")
    workload, counters = find_workload(str(row["workload"])), find_method(str(row["method"])).counters
    names = [
        *(() if row["status"] == "ok" else ("status", "error")),
        "triangles",
        *(column.name for column in (*workload.columns, *counters)),
        "threads",
        "rounds",
        "cpu",
        "warnings",
    ]
    known = columns()
    for name in dict.fromkeys(names):
        if pd.isna(row[name]) or any(part in name for part in _PARTS):
            continue
        column = known[name]
        stem, end = (name[:-2], "_s") if column.unit == "s" else (name, "")
        interval = [row.get(f"{stem}{part}{end}") for part in ("_low", "_high")]
        text = _say(row[name], *column.shown)
        if not any(pd.isna(value) for value in interval):
            low, high = (_say(value, "", column.shown[1]) for value in interval)
            text += f"  [{low}, {high}]"
        heading = stem.removesuffix("_bytes").replace("_", " ")
        shown.add_row(heading, escape(printable(text)), escape(column.help.removeprefix("median of ")))
    console.print(shown)


def _say(value: Any, unit: str, factor: float) -> str:
    if isinstance(value, str):
        return value
    shown = value if factor == 1 else value * factor
    whole = isinstance(shown, int) or float(shown).is_integer()
    text = f"{shown:,.0f}" if whole else f"{shown:,.1f}" if factor != 1 else f"{shown:.3g}"
    return f"{text} {unit}".strip()


def print_sweep(tables: Tables, folder: Path, console: Console) -> None:
    """What every workload says of its rows and of those of its processes, and every row that is missing."""
    table = tables.points
    for workload in WORKLOADS:
        shown: Any = workload.part("shown")
        points = workload_rows(table[table["status"].eq("ok").fillna(False).astype(bool)], workload.name)
        if workload.told and len(points):
            console.print(told_table(workload, points))
        for part, rows in (("sweep_lines", table), ("process_lines", tables.processes)):
            lines = getattr(shown, part, None)
            if lines is None or not rows["workload"].eq(workload.name).any():
                continue
            measured = workload_rows(rows, workload.name)
            measured = measured[(measured["status"] == "ok").astype(bool)]
            for line in lines(measured) if len(measured) else ():
                if isinstance(line, str):
                    say(console, line)
                else:
                    console.print(line)
        if hasattr(shown, "CLAIMS"):
            for line in claim_lines(shown.CLAIMS, workload_rows(tables.processes, workload.name)):
                say(console, line)
    missing = table[table["status"] != "ok"]
    reasons = missing["error"].map(without_numbers)
    said = [", ".join(_say_workload(row)) for _, row in missing.iterrows()]
    workloads = pd.Series(said, index=missing.index, dtype="object")
    of_workloads = (name for workload in WORKLOADS for name in plain_options(workload.options()))
    varying = settings_that_vary(table, {*best_of(), "packet_width", *of_workloads})
    for (scene, status, _, workload), rows in missing.groupby(["scene", "status", reasons, workloads], sort=False):
        names = [[say_point(row), *(say_setting(name, row[name]) for name in varying)] for _, row in rows.iterrows()]
        say(console, f"{status}: {scene}, {workload}, {'; '.join(dict.fromkeys(map(', '.join, names)))}")
        say(console, f"    {rows['error'].iloc[0]}")
    counts = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    flagged = int(table["warnings"].notna().sum())
    counts += f" ({flagged} with warnings about their times, see the column warnings)" if flagged else ""
    files = ", ".join(path.name for path in sorted(folder.iterdir()) if path.is_file() and path.name[0] != ".")
    say(console, f"{counts or 'nothing measured'}; in {folder}: {files}")


def say_problems(table: pd.DataFrame, records: Iterable[Record], left: int) -> str | None:
    """Why a sweep ends with an error, None = it does not. left: points without a record."""
    failed = int((table["status"] == "failed").sum())
    wrong = sum(say_wrong_image(record.results) is not None for record in records)
    told = [f"{failed} points failed"] * bool(failed) + [f"{left} points have no record"] * bool(left)
    again = [f"{', '.join(told)}; the same command tries them again"] * bool(told)
    return "; ".join([*again, *[f"processes that saw a wrong image: {wrong}"] * bool(wrong)]) or None


def claim_lines(claims: Sequence[Claim], processes: pd.DataFrame) -> Iterator[str]:
    """A line for every claim that was measured: its verdict, value and reason."""
    for judged in judge_all(claims, processes):
        if judged.verdict != NOT_MEASURED:
            told = ", ".join(filter(None, [judged.value, judged.why]))
            yield f"{judged.text} {judged.verdict}{f' ({told})' if told else ''}"


def results_console() -> Console:
    """Where results are printed: as wide as the terminal, and 80 columns where there is none to ask."""
    return Console()
