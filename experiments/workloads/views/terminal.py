"""Many views and batches of rays, as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import say_kind
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.screen import narrow_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line for every point. rows: those of this workload that were measured."""
    table = narrow_table(
        "many views, or a batch of rays: seconds, and the gain of the library",
        "scene, method", ("job", "this", "library", "gain", "interval", "ids\nequal"),
    )  # fmt: skip
    varying = settings_that_vary(rows, ("job", "packet_width"))
    for _, row in rows.iterrows():
        words = [str(row["scene"]), say_kind(row), *(say_setting(name, row[name]) for name in varying)]
        ends = (row["library_gain_low"], row["library_gain_high"])
        table.add_row(
            escape(printable(", ".join(words))),
            str(row["job"]).replace("_", "\n"),
            f"{row['job_time_s']:.3f}",
            f"{row['library_time_s']:.3f}",
            f"{row['library_gain']:.2f}x",
            "" if pd.isna(ends[0]) else f"{ends[0]:.2f}-{ends[1]:.2f}",
            f"{row['ids_equal']:.5f}",
        )
    yield table
