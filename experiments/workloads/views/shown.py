"""Terminal output of many views and batches of rays."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.methods.naming import say_kind
from experiments.results.settings import settings_that_vary
from experiments.workloads.tables import narrow_table, plain, varying_words


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "many views, or a batch of rays: seconds, and the gain of the library"
    table = narrow_table(title, "scene, method", ("job", "this", "library", "gain", "interval", "ids\nequal"))
    varying = settings_that_vary(rows, ("job", "packet_width"))
    for _, row in rows.iterrows():
        low, high = row["library_gain_low"], row["library_gain_high"]
        table.add_row(
            plain(row["scene"], say_kind(row), *varying_words(row, varying)),
            str(row["job"]).replace("_", "\n"),
            *(f"{row[name]:.3f}" for name in ("job_time_s", "library_time_s")),
            f"{row['library_gain']:.2f}x",
            "" if pd.isna(low) else f"{low:.2f}-{high:.2f}",
            f"{row['ids_equal']:.5f}",
        )
    yield table
