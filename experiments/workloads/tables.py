"""Tables of results for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd
from rich import box
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.harness.column import WHOLE, Column
from experiments.harness.point import Workload
from experiments.methods.naming import best_of, say_kind, say_point
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.series import best_rows


def narrow_table(title: str, first: str, headings: Sequence[str]) -> Table:
    """An empty table. first: heading of the first column, which wraps. headings: of the right-aligned others."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column(first, overflow="fold", min_width=16)
    for name in headings:
        table.add_column(name, justify="right")
    return table


def plain(*words: object) -> str:
    """Words with commas between them, safe to print: names of scenes may hold markup and control characters."""
    return escape(printable(", ".join(map(str, words))))


def varying_words(row: pd.Series, varying: Sequence[str]) -> list[str]:
    """The varying settings of a row, in words."""
    return [say_setting(name, row[name]) for name in varying]


def times(row: pd.Series, *names: str) -> list[str]:
    """Ratios of a row, "1.25x" each."""
    return [f"{row[name]:.2f}x" for name in names]


def best_by_kind(rows: pd.DataFrame) -> Iterator[tuple[str, pd.Series, pd.DataFrame]]:
    """Every point in words, its row, and the rows that it stands for: of several splits the best one is told."""
    varying = settings_that_vary(rows, (*best_of(), "packet_width"))
    keys = [
        (row["scene"], say_kind(row), *varying_words(row, varying), str(row["packet_width"]),
         row["point_id"] if pd.isna(row["split_x"]) else "")
        for _, row in rows.iterrows()
    ]  # fmt: skip
    for _, some in rows.groupby(pd.Series(keys, index=rows.index, dtype="object"), sort=False):
        row = (best_rows(some) if len(some) > 1 else some).iloc[0]
        yield plain(row["scene"], say_point(row), *varying_words(row, varying)), row, some


def told_table(workload: Workload, rows: pd.DataFrame) -> Table:
    """The columns that a workload names, with {} where the ends of intervals stand, of every point; of several splits
    of the best one, with all that is wrong over the splits."""
    known = {column.name: column for column in workload.columns}
    told = [(known[name.format("")], "{}" in name) for name in workload.told]
    names = (column.name.removesuffix(f"_{column.unit}").replace("speedup_vs", "over") for column, _ in told)
    headings = [name.replace("_", "\n") for name in names]
    table = narrow_table(workload.name.replace("_", " "), "scene, method", headings)
    for words, row, some in best_by_kind(rows):
        wrong = {column.name: some[column.name].sum() for column, _ in told if column.over is max}
        shown = row.to_dict() | wrong
        table.add_row(words, *(_say_cell(shown, column, has_ends) for column, has_ends in told))
    return table


def _say_cell(row: Mapping[str, Any], column: Column, has_ends: bool) -> str:
    value, (unit, factor) = row[column.name], column.shown
    if pd.isna(value):
        return ""
    if unit or column.dtype == WHOLE or value >= 1e5:
        return f"{value * factor:,{'.1f' if unit else '.0f'}} {unit}".strip()
    low, high = (row.get(f"{column.name}{end}") for end in ("_low", "_high"))
    if has_ends and not (pd.isna(low) or pd.isna(high)):
        return f"{value:.2f} [{low:.2f}, {high:.2f}]"
    return f"{value:.{5 if column.over is min else 2}f}"  # of a least share, what lacks to 1 counts
