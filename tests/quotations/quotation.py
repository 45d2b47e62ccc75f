"""Quotation: what a page says of a kept table; and how numbers are written in pages."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import floor, log10
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.workloads.ratios import best_rows
from tests.folders import ROOT

REFERENCE = ROOT / "reports" / "reference"
TIMES = "\N{MULTIPLICATION SIGN}"
SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")


@dataclass(frozen=True)
class Kept:
    """What is kept of a sweep. points: a row a point. processes: a row a process of it. claims: those judged."""

    points: pd.DataFrame
    processes: pd.DataFrame
    claims: list[dict[str, Any]]


@dataclass(frozen=True)
class Quoted:
    """rows: of a table of the page. phrases: of its text."""

    rows: tuple[str, ...] = ()
    phrases: tuple[str, ...] = ()

    @property
    def fragments(self) -> tuple[str, ...]:
        return (*self.rows, *self.phrases)


@dataclass(frozen=True)
class Quotation:
    """page: that quotes. sweep: whose tables are kept in a folder of that name. make: what is quoted of them."""

    page: str
    sweep: str
    make: Callable[[Kept], Quoted]

    @property
    def name(self) -> str:
        return self.make.__name__

    @property
    def folder(self) -> Path:
        return REFERENCE / self.sweep

    def quoted(self) -> Quoted:
        points, processes = (
            pd.read_parquet(path) if path.exists() else pd.DataFrame()
            for path in (self.folder / "table.parquet", self.folder / "processes.parquet")
        )
        claims = self.folder / "claims.json"
        judged = json.loads(claims.read_text(encoding="utf-8")) if claims.exists() else []
        return self.make(Kept(points, processes, judged))


def mark(name: str) -> str:
    """The line of a page above the table whose rows are a quotation's."""
    return f"<!-- rows: {name} -->"


def with_rows(page: str, name: str, rows: tuple[str, ...]) -> str:
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


def split_of(row: pd.Series) -> str:
    return f"{row['split_x']:,} {TIMES} {row['split_y']:,}"


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


def best(table: pd.DataFrame, **values: Any) -> pd.Series:
    """Of the rows with these values the best split, as everywhere (`experiments.workloads.ratios.best_rows`)."""
    rows = best_rows(of(table, **values))
    assert len(rows) == 1, f"{len(rows)} best rows for {values}"
    return rows.iloc[0]
