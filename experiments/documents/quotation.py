"""Quotation: what a page says of a kept table; and how numbers are written in pages."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from math import floor, log10
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.results.intervals import with_intervals
from experiments.results.statistics import Estimate
from experiments.results.table import rename_workloads
from experiments.workloads.series import best_rows
from scenes.directory import PAPER_SCENES as SCENES

ROOT = Path(__file__).resolve().parents[2]
REFERENCE = ROOT / "reports" / "reference"
TIMES = "\N{MULTIPLICATION SIGN}"


@dataclass(frozen=True)
class Kept:
    """What is kept of a sweep. points: a row a point. processes: a row a process of it. claims: those judged."""

    points: pd.DataFrame
    processes: pd.DataFrame = field(default_factory=pd.DataFrame)
    claims: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Quotation:
    """page: that quotes. sweep: whose tables are kept in a folder of that name. make: what is quoted of them; lines
    that begin with a bar are rows of a table of the page, others phrases of its text."""

    page: str
    sweep: str
    make: Callable[[Kept], Iterable[str]]

    @property
    def name(self) -> str:
        return self.make.__name__

    @property
    def folder(self) -> Path:
        return REFERENCE / self.sweep

    def rows_and_phrases(self) -> tuple[list[str], list[str]]:
        return _said(self)


@cache
def _said(quotation: Quotation) -> tuple[list[str], list[str]]:
    kept = kept_in(quotation.folder)
    lines = list(quotation.make(Kept(kept.points.copy(), kept.processes.copy(), kept.claims)))
    return [one for one in lines if one.startswith("|")], [one for one in lines if not one.startswith("|")]


@cache
def kept_in(folder: Path) -> Kept:
    """What a folder keeps; read once, as a table of hundreds of columns takes a tenth of a second."""
    points, processes = (
        rename_workloads(pd.read_parquet(path)) if path.exists() else pd.DataFrame()
        for path in (folder / "table.parquet", folder / "processes.parquet")
    )
    if len(processes):
        points = with_intervals(points, processes)
    claims = folder / "claims.json"
    return Kept(points, processes, json.loads(claims.read_text(encoding="utf-8")) if claims.exists() else [])


def mark(name: str) -> str:
    """The line of a page above the table whose rows are a quotation's."""
    return f"<!-- rows: {name} -->"


def with_rows(page: str, name: str, rows: Iterable[str]) -> str:
    """The page with other rows in the table below the mark: after a line of text or none, a head and a rule. Raises
    ValueError for a page without it."""
    lines = page.splitlines()
    if mark(name) not in lines:
        raise ValueError(f"the page has no line {mark(name)}")
    first = next(k for k in range(lines.index(mark(name)), len(lines)) if lines[k].startswith("|---")) + 1
    last = next((k for k in range(first, len(lines)) if not lines[k].startswith("|")), len(lines))
    return "\n".join([*lines[:first], *rows, *lines[last:]]) + "\n"


def digits(value: float, count: int = 3) -> str:
    """So many significant digits, but two decimals at most: 16.5, 9.25, 0.68."""
    decimals = count - 1 - floor(log10(value))
    return f"{value:.{min(max(decimals, 0), 2)}f}"


def interval(row: pd.Series, name: str) -> str:
    """ "2.40 [2.39, 2.46]"; without the interval where there is none."""
    if pd.isna(row[f"{name}_low"]):
        return digits(row[name])
    return f"{digits(row[name])} [{digits(row[f'{name}_low'])}, {digits(row[f'{name}_high'])}]"


def say(estimate: Estimate) -> str:
    """ "2.40 [2.39, 2.46]"."""
    return f"{digits(estimate.value)} [{digits(estimate.low)}, {digits(estimate.high)}]"


def split_of(row: pd.Series) -> str:
    return f"{int(row['split_x']):,} {TIMES} {int(row['split_y']):,}"


def milliseconds(seconds: float) -> str:
    return f"{seconds * 1e3:.1f}"


def power_of_ten(value: float) -> str:
    exponent = floor(log10(value))
    return f"{value / 10**exponent:.1f} · 10{str(exponent).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def table_row(*cells: Any) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def of(table: pd.DataFrame, **values: Any) -> pd.DataFrame:
    """The measured rows with these values."""
    chosen = table["status"].eq("ok")
    for name, value in values.items():
        chosen &= table[name].eq(value)
    return table[chosen.fillna(False).astype(bool)]


def estimate(processes: pd.DataFrame, column: str, **values: Any) -> Estimate:
    """The mean of a column with its error, over the processes that have these values."""
    return Estimate.of(of(processes, **values)[column].astype(float).tolist())


def best(table: pd.DataFrame, **values: Any) -> pd.Series:
    """The row of the best split among those with these values (`experiments.workloads.series.best_rows`)."""
    rows = best_rows(of(table, **values))
    assert len(rows) == 1, f"{len(rows)} best rows for {values}"
    return rows.iloc[0]


def each_scene(table: pd.DataFrame, **values: Any) -> list[pd.Series]:
    """The one row of each scene."""
    found = [of(table, scene=scene, **values) for scene in SCENES]
    assert all(len(rows) == 1 for rows in found), values
    return [rows.iloc[0] for rows in found]


def best_of_each(table: pd.DataFrame, **values: Any) -> list[pd.Series]:
    """The best row of each scene."""
    return [best(table, scene=scene, **values) for scene in SCENES]


def number(row: pd.Series, name: str) -> str:
    return digits(row[name])


def line(
    label: str, rows: Iterable[pd.Series], column: str, say: Callable[[pd.Series, str], str] = number, *more: Any
) -> str:
    """A row of a page: the label, this column of each row as `say` writes it, and more cells."""
    return table_row(label, *(say(row, column) for row in rows), *more)


def span(values: Iterable[float]) -> str:
    """ "1.22 to 1.98", or "0.98" where both ends are written alike."""
    known = [value for value in values if not pd.isna(value)]
    low, high = digits(min(known)), digits(max(known))
    return low if low == high else f"{low} to {high}"
