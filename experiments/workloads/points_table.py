"""A table for people with a line for every point: what tells it apart, and some of its numbers."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.screen import narrow_table


def points_table(title: str, rows: pd.DataFrame, columns: Mapping[str, tuple[str, str]]) -> Table:
    """columns: heading -> the column of `rows` and how its numbers are formatted; what is missing stays blank."""
    table = narrow_table(title, "point", list(columns))
    varying = settings_that_vary(rows)
    for _, row in rows.iterrows():
        words = [row["scene"], *(say_setting(name, row[name]) for name in varying)]
        numbers = [form.format(row[name]) if pd.notna(row[name]) else "" for name, form in columns.values()]
        table.add_row(escape(printable(", ".join(map(str, words)))), *numbers)
    return table
