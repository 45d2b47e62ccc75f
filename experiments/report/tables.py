"""Tables of the page: one a workload, rounded for reading, of what tells its points apart and what was measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import pandas as pd

from experiments.harness.column import TEXT, TRUTH, Column
from experiments.harness.point import Workload
from experiments.methods import METHODS
from experiments.results.settings import settings_that_vary
from experiments.results.table import columns, workload_rows
from experiments.workloads import WORKLOADS

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
    identity = dict.fromkeys(["scene", "method", *(field.name for one in options for field in fields(one))])
    known = columns()
    shared = Counter(column.name for one in WORKLOADS for column in one.columns)
    own = sorted((column.name for column in workload.columns), key=shared.__getitem__)
    counters = [column.name for method in METHODS for column in method.counters]
    names = dict.fromkeys([*identity, *settings_that_vary(rows, identity), *own, *counters, "doubts"])
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
