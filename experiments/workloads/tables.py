"""Tables of results for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import pandas as pd
from rich import box
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.harness.column import WHOLE, Column
from experiments.harness.point import Workload
from experiments.methods.naming import TIMES, best_of, say_kind, say_split
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.resources import say_ms
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
    """Words, the best row and all rows of each scene, kind of method, settings that vary, and packet width."""
    varying = settings_that_vary(rows, (*best_of(), "packet_width"))
    words = [", ".join([say_kind(row), *varying_words(row, varying)]) for _, row in rows.iterrows()]
    told = pd.Series(words, index=rows.index, dtype="object")
    for (_, said, _), some in rows.groupby(["scene", told, "packet_width"], sort=False, dropna=False):
        yield said, best_rows(some).iloc[0], some


Cell = Callable[[pd.Series], str]
"""A row -> what stands in one of its cells."""


def _ratio(name: str) -> Cell:
    """The ratio in a column, blank where it is missing."""
    return lambda row: "" if pd.isna(row[name]) else f"{row[name]:.2f}x"


def told_table(workload: Workload, rows: pd.DataFrame) -> Table:
    """A line for every point: the columns that the workload names, with {} where the ends of intervals stand."""
    known = {column.name: column for column in workload.columns}
    told = [(known[name.format("")], "{}" in name) for name in workload.told]
    names = (column.name.removesuffix(f"_{column.unit}").replace("speedup_vs", "over") for column, _ in told)
    headings = [name.replace("_", "\n") for name in names]
    table = narrow_table(workload.name.replace("_", " "), "scene, method", headings)
    varying = settings_that_vary(rows, ("packet_width",))
    for _, row in rows.iterrows():
        name = plain(row["scene"], say_kind(row), *varying_words(row, varying))
        table.add_row(name, *(_say_cell(row, column, has_ends) for column, has_ends in told))
    return table


def _say_cell(row: pd.Series, column: Column, has_ends: bool) -> str:
    value, (unit, factor) = row[column.name], column.shown
    if pd.isna(value):
        return ""
    if unit or column.dtype == WHOLE or value >= 1e5:
        return f"{value * factor:,{'.1f' if unit else '.0f'}} {unit}".strip()
    low, high = (row.get(f"{column.name}{end}") for end in ("_low", "_high"))
    if has_ends and not (pd.isna(low) or pd.isna(high)):
        return f"{value:.2f} [{low:.2f}, {high:.2f}]"
    return f"{value:.{5 if column.over is min else 2}f}"  # of a least share, what lacks to 1 counts


def best_split_table(rows: pd.DataFrame, unlike: str) -> Table:
    """The best split of each scene, kind of method and packet width, with all that is wrong over the splits.

    rows: measured, of one workload. unlike: the column that counts deviating pixels.
    """
    title = "best split of each scene, and speed-up over single rays and packets"
    table = narrow_table(title, "scene, method", [*_OF_SPLITS, unlike.replace("_", "\n")])
    for kind, row, some in best_by_kind(rows):
        cells = (say(row) for say in _OF_SPLITS.values())
        table.add_row(plain(row["scene"], kind), *cells, str(some[unlike].sum()))
    return table


_OF_SPLITS: dict[str, Cell] = {
    "packets\nof": lambda row: str(width) if pd.notna(width := row["packet_width"]) and width > 0 else "",
    "split": lambda row: say_split(row).partition(",")[0].replace(TIMES, "x"),
    "frame": lambda row: say_ms(row["render_time_s"]),
    "single\nrays": _ratio("speedup"),
    "packets": _ratio("speedup_vs_packets"),
}
