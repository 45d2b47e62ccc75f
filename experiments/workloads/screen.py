"""Tables of results for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich import box
from rich.table import Table


def narrow_table(title: str, text: str, numbers: Sequence[str]) -> Table:
    """An empty table. text: heading of the first column, which is broken between words. numbers: of the others, which
    are set to the right; a heading may have several lines."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column(text, overflow="fold")
    for name in numbers:
        table.add_column(name, justify="right")
    return table
