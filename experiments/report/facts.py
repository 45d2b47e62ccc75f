"""The table in short: warnings, missing points, wrong pixels, the machine in words; and a table of each workload."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import pandas as pd

from experiments.drawing.values import column
from experiments.harness.column import TEXT, TRUTH, Column
from experiments.harness.point import Workload
from experiments.harness.processes.idle import BUSY_SHARE_OF_ALL_CORES
from experiments.methods import METHODS
from experiments.methods.naming import say_point
from experiments.results.settings import NUMBER, settings_that_vary, without_numbers
from experiments.results.table import columns, workload_rows
from experiments.results.time_warnings import WRONG
from experiments.workloads import WORKLOADS

_TO = "\N{EN DASH}"


@dataclass(frozen=True)
class TimeWarning:
    """A kind of warning, its numbers as ranges, and how many points carry it."""

    text: str
    points: int


@dataclass(frozen=True)
class Warnings:
    """Counts of a figure's points: all, measured, and with any warning; and which warnings."""

    points: int
    measured: int
    flagged: int
    kinds: tuple[TimeWarning, ...]


@dataclass(frozen=True)
class MissingPoints:
    """Points of a scene without a measurement that counts, for one reason."""

    status: str
    scene: str
    stands_for: str | None
    reason: str
    points: tuple[str, ...]


def stand_ins(table: pd.DataFrame) -> dict[str, str]:
    """Scenes of the table and the paper's that they stand for, in the order of the table."""
    rows = table[["scene", "stands_for"]][table["stands_for"].notna()]
    return dict(zip(rows["scene"], rows["stands_for"], strict=True))


@dataclass(frozen=True)
class ComparedImages:
    """How many images were compared with that of rtcIntersect1, the wrong pixels of all of them, and the holes of ours
    and of rtcIntersect1 among these."""

    images: int
    pixels_wrong: int
    pixels_hole: int


def compared_images(table: pd.DataFrame) -> ComparedImages:
    """How many images of measured points were compared, and how many of their pixels are wrong."""
    rows = table[table["status"].isin(("ok", WRONG)) & table["pixels_wrong"].notna()]
    wrong, *holes = (int(column(rows, name).sum()) for name in ("pixels_wrong", "pixels_hole", "baseline_pixels_hole"))
    return ComparedImages(len(rows), wrong, sum(holes))


@dataclass(frozen=True)
class Processes:
    """Processes that measured timed and other points, those of them that were left out, and the points they are of."""

    all: int
    left_out: int
    points: int


def count_processes(table: pd.DataFrame) -> Processes:
    """Processes of the points that were not skipped and did not fail."""
    out = table["processes_left_out"].fillna(0)
    measured = table.loc[table["status"].isin(("ok", WRONG)), "processes"].sum()
    return Processes(int(measured + out.sum()), int(out.sum()), int((out > 0).sum()))


def load_in_short(table: pd.DataFrame) -> str | None:
    """How busy others kept the cores while processes measured or, of rows that do not tell, the load before; None if
    nobody knows."""
    taken = (table["others_share"] + table["stolen_share"].fillna(0.0)).dropna()
    if len(taken) == 0:
        load = table["load_average"].dropna()
        return f"{load.min():.1f} to {load.max():.1f} before a process" if len(load) else None
    said = f"others took {taken.min():.1%} to {taken.max():.1%} of its cores while it measured"
    return f"nothing else was running: {said}" if taken.max() <= BUSY_SHARE_OF_ALL_CORES else said


def _first(values: pd.Series) -> Any:
    present = values.dropna()
    return present.iloc[0] if len(present) else None


def count_warnings(rows: pd.DataFrame) -> Warnings:
    """Warnings that differ only in their numbers are one kind; the numbers become ranges."""
    texts = [text for warnings in rows["warnings"].dropna() for text in str(warnings).split("; ")]
    numbers: dict[str, list[list[str]]] = {}
    for text in texts:
        numbers.setdefault(without_numbers(text), []).append(NUMBER.findall(text))
    kinds = [TimeWarning(_with_ranges(kind, texts), len(texts)) for kind, texts in numbers.items()]
    return Warnings(
        points=len(rows),
        measured=int((rows["status"] == "ok").sum()),
        flagged=int(rows["warnings"].notna().sum()),
        kinds=tuple(sorted(kinds, key=lambda warning: -warning.points)),
    )


def _with_ranges(kind: str, texts: list[list[str]]) -> str:
    for numbers in zip(*texts, strict=True):
        ordered = sorted(set(numbers), key=lambda text: float(text.replace(",", "")))
        kind = kind.replace("#", ordered[0] if len(ordered) == 1 else f"{ordered[0]}{_TO}{ordered[-1]}", 1)
    return kind


def missing_points(table: pd.DataFrame) -> tuple[MissingPoints, ...]:
    """Points that were skipped, failed or saw a wrong image; those of a scene whose reasons differ only in their
    numbers stand together."""
    missing = table[table["status"] != "ok"]
    kind = missing["error"].fillna("no reason was recorded").map(without_numbers)
    groups = missing.groupby(["status", "scene", kind], sort=False)
    return tuple(
        MissingPoints(
            str(status),
            str(scene),
            _first(rows["stands_for"]),
            _first(rows["error"]) or "no reason was recorded",
            tuple(f"{row['workload']}: {say_point(row)}" for _, row in rows.iterrows()),
        )
        for (status, scene, _), rows in groups
    )


def measured_between(table: pd.DataFrame) -> str | None:
    """When its rows were measured, to the minute of UTC; None if nobody knows."""
    moments = sorted(str(moment)[:16].replace("T", " ") for moment in table["measured_at"].dropna())
    return f"{' to '.join(dict.fromkeys([moments[0], moments[-1]]))} UTC" if moments else None


def machine_in_short(environment: dict[str, Any]) -> str:
    """Processor, cores and system in one line."""
    cores = environment.get("logical_cores")
    parts = [environment.get("cpu"), f"{cores} hardware threads" if cores else None, environment.get("system")]
    return ", ".join(str(part) for part in parts if part) or "an unknown machine"


def software_in_short(environment: dict[str, Any]) -> str:
    """Versions and the commit in one line."""
    named = {"atra": "atra_version", "Embree": "embree_version", "Numba": "numba_version", "Python": "python_version"}
    parts = [f"{label} {environment[name]}" for label, name in named.items() if environment.get(name)]
    commit = environment.get("git_commit")
    if commit:
        parts.append(f"commit {str(commit)[:12]}{' with changes' if environment.get('git_dirty') else ''}")
    return ", ".join(parts) or "unknown versions"


_ENDS = ("_low", "_high", "_low_s", "_high_s", "_half")
"""Endings of columns without a cell of their own: they are shown as another's interval, or only in the files."""


@dataclass(frozen=True)
class Heading:
    """unit: what the numbers are shown in, "" if plain. number: they are set to the right."""

    name: str
    text: str
    unit: str
    help: str
    number: bool


@dataclass(frozen=True)
class WorkloadTable:
    """The measured points of a workload. rows: of each its cells, a text and its interval, or ""; and whose
    stand-in its scene is, or None."""

    workload: str
    headings: tuple[Heading, ...]
    rows: tuple[tuple[tuple[tuple[str, str], ...], str | None], ...]


def workload_tables(table: pd.DataFrame) -> Iterator[WorkloadTable]:
    """One for each workload of which a point was measured."""
    present = set(table["workload"])
    for workload in WORKLOADS:
        if workload.name not in present:
            continue
        rows = workload_rows(table, workload.name)
        measured = rows[(rows["status"] == "ok").astype(bool)]
        if len(measured):
            shown = _columns(rows, measured, workload)
            headings = tuple(_heading(column) for column in shown)
            cells = [
                (tuple(_cell(row, column) for column in shown), _stands_for(row)) for _, row in measured.iterrows()
            ]
            yield WorkloadTable(workload.name, headings, tuple(cells))


def _stands_for(row: pd.Series) -> str | None:
    """The paper's scene that a row's scene replaces without being it."""
    return None if pd.isna(row["stands_for"]) else str(row["stands_for"])


def _columns(rows: pd.DataFrame, measured: pd.DataFrame, workload: Workload) -> list[Column]:
    """What tells points apart, then what was measured: first what few other workloads measure too."""
    options = [*(method.options for method in METHODS), workload.options]
    identity = dict.fromkeys(["scene", "method", *(field.name for kind in options for field in fields(kind))])
    known = columns()
    shared = Counter(column.name for kind in WORKLOADS for column in kind.columns)
    own = sorted((column.name for column in workload.columns), key=shared.__getitem__)
    counters = [column.name for method in METHODS for column in method.counters]
    names = dict.fromkeys([*identity, *settings_that_vary(rows, identity), *own, *counters, "warnings"])
    return [known[name] for name in names if not name.endswith(_ENDS) and measured[name].notna().any()]


def _heading(column: Column) -> Heading:
    unit, factor = column.shown
    unit = unit if factor != 1.0 else ""
    text = column.name.removesuffix(f"_{column.unit}") if unit else column.name
    return Heading(column.name, text.replace("_", " "), unit, column.help, column.dtype not in (TEXT, TRUTH))


def _cell(row: pd.Series, column: Column) -> tuple[str, str]:
    """The value, and its 95 % confidence interval over processes."""
    end = "_s" if column.unit == "s" else ""
    stem = column.name.removesuffix(end)
    _, factor = column.shown
    low, high = (_say_value(row.get(f"{stem}_{side}{end}"), factor) for side in ("low", "high"))
    return _say_value(row[column.name], factor), f"[{low}, {high}]" if low and high else ""


def _say_value(value: Any, factor: float = 1.0) -> str:
    """ "1,024", "3.14", "1.5e-07", "yes", a text as it is, "" where there is none."""
    if value is None or pd.isna(value):
        return ""
    if isinstance(value, str):
        return value
    if pd.api.types.is_bool(value):
        return "yes" if value else "no"
    if pd.api.types.is_integer(value) and factor == 1:
        return f"{value:,}"
    number = float(value) * factor
    return f"{number:,.2f}" if number == 0 or abs(number) >= 0.005 else f"{number:.1e}"
