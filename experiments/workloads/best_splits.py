"""Best splits of a workload that is timed beside single rays and packets, as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import TIMES, best_of, say_kind, say_split
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.ratios import best_rows
from experiments.workloads.resources import say_ms
from experiments.workloads.screen import narrow_table


def rows_by_kind(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows of each scene, kind of method and packet width, and in words the kind and the settings that vary."""
    varying = settings_that_vary(rows, (*best_of(), "packet_width"))
    kinds = pd.Series(
        [", ".join([say_kind(row), *(say_setting(name, row[name]) for name in varying)]) for _, row in rows.iterrows()],
        index=rows.index,
        dtype="object",
    )
    for (_, kind, _), some in rows.groupby(["scene", kinds, "packet_width"], sort=False):
        yield kind, some


def best_split_table(rows: pd.DataFrame, unlike: str) -> Table:
    """The best split of each scene, kind of method and packet width, with all that is wrong over the splits.

    rows: measured, of one workload. unlike: the column that counts pixels that are not as they should be.
    """
    numbers = ("packets\nof", "split", "frame", "single\nrays", "packets", unlike.replace("_", "\n"))
    best = narrow_table("best split of each scene, and speed-up over single rays and packets", "scene, method", numbers)
    for kind, some in rows_by_kind(rows):
        row = best_rows(some).iloc[0]
        best.add_row(
            escape(printable(f"{row['scene']}, {kind}")),
            str(row["packet_width"]),
            say_split(row).partition(",")[0].replace(TIMES, "x"),
            say_ms(row["render_time_s"]),
            f"{row['speedup']:.2f}x",
            f"{row['speedup_vs_packets']:.2f}x",
            str(some[unlike].sum()),
        )
    return best
