"""Tables of results for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import pandas as pd
from rich import box
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import TIMES, best_of, say_kind, say_split
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.resources import say_ms
from experiments.workloads.series import best_rows


def narrow_table(title: str, first: str, headings: Sequence[str]) -> Table:
    """An empty table. first: heading of the first column, which wraps. headings: of the right-aligned others."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column(first, overflow="fold")
    for name in headings:
        table.add_column(name, justify="right")
    return table


def plain(*words: object) -> str:
    """Words with commas between them, safe to print: names of scenes may hold markup and control characters."""
    return escape(printable(", ".join(map(str, words))))


def varying_words(row: pd.Series, varying: Sequence[str]) -> list[str]:
    """The varying settings of a row, in words."""
    return [say_setting(name, row[name]) for name in varying]


def grid_of(row: pd.Series) -> str:
    """The split of a row in ASCII, "128 x 1"."""
    return say_split(row).partition(",")[0].replace(TIMES, "x")


def times(row: pd.Series, *names: str) -> list[str]:
    """Ratios of a row, "1.25x" each."""
    return [f"{row[name]:.2f}x" for name in names]


def best_rows_by(
    rows: pd.DataFrame, words: Sequence[Sequence[str]], column: str
) -> Iterator[tuple[str, pd.Series, pd.DataFrame]]:
    """The words, the best row and all rows of each scene, words (of each row) and value of the column."""
    told = pd.Series([", ".join(of_row) for of_row in words], index=rows.index, dtype="object")
    for (_, said, _), some in rows.groupby(["scene", told, column], sort=False, dropna=False):
        yield said, best_rows(some).iloc[0], some


def best_by_kind(rows: pd.DataFrame) -> Iterator[tuple[str, pd.Series, pd.DataFrame]]:
    """`best_rows_by` kind of method, settings that vary, and packet width."""
    varying = settings_that_vary(rows, (*best_of(), "packet_width"))
    words = [[say_kind(row), *varying_words(row, varying)] for _, row in rows.iterrows()]
    return best_rows_by(rows, words, "packet_width")


Cell = Callable[[pd.Series], str]
"""A row -> what stands in one of its cells."""


def cell(name: str, form: str = "{:.2f}x", factor: float = 1.0) -> Cell:
    """The number in a column of the table times a factor, in a format; a missing one stays blank."""
    return lambda row: "" if pd.isna(row[name]) else form.format(row[name] if factor == 1.0 else row[name] * factor)


def points_table(
    title: str, rows: pd.DataFrame, columns: Mapping[str, Cell], first: str = "point",
    words: Callable[[pd.Series], Sequence[object]] = lambda row: (), shown: Sequence[str] = (),
) -> Table:  # fmt: skip
    """A line for every point: what tells it apart, and some of its numbers.

    columns: heading -> its cells. words: of a row, after its scene. shown: settings that words or columns tell.
    """
    table = narrow_table(title, first, list(columns))
    varying = settings_that_vary(rows, shown)
    for _, row in rows.iterrows():
        name = plain(row["scene"], *words(row), *varying_words(row, varying))
        table.add_row(name, *(say(row) for say in columns.values()))
    return table


def best_table(
    title: str, first: str, best: Iterable[tuple[Sequence[object], pd.Series, pd.DataFrame]],
    columns: Mapping[str, Cell], counted: str,
) -> Table:  # fmt: skip
    """A line for every best row: some of its numbers, and how many pixels count over all rows that it is the best of.

    best: words after the scene, best row, all rows. columns: heading -> its cells. counted: a column of pixels.
    """
    table = narrow_table(title, first, [*columns, counted.replace("_", "\n")])
    for words, row, some in best:
        cells = (say(row) for say in columns.values())
        table.add_row(plain(row["scene"], *words), *cells, str(some[counted].sum()))
    return table


def best_split_table(rows: pd.DataFrame, unlike: str) -> Table:
    """The best split of each scene, kind of method and packet width, with all that is wrong over the splits.

    rows: measured, of one workload. unlike: the column that counts deviating pixels.
    """
    title = "best split of each scene, and speed-up over single rays and packets"
    best = (([kind], row, some) for kind, row, some in best_by_kind(rows))
    return best_table(title, "scene, method", best, _OF_SPLITS, unlike)


_OF_SPLITS: dict[str, Cell] = {
    "packets\nof": lambda row: str(width) if pd.notna(width := row["packet_width"]) and width > 0 else "",
    "split": grid_of,
    "frame": lambda row: say_ms(row["render_time_s"]),
    "single\nrays": cell("speedup"),
    "packets": cell("speedup_vs_packets"),
}
