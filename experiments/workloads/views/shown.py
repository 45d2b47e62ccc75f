"""Terminal output of many views."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.methods.naming import say_kind
from experiments.workloads.tables import cell, points_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "many views: seconds, and the gain of the library"
    yield points_table(title, rows, _COLUMNS, "scene, method", lambda row: [say_kind(row)], ("packet_width",))


def _interval(row: pd.Series) -> str:
    low, high = row["library_gain_low"], row["library_gain_high"]
    return "" if pd.isna(low) else f"{low:.2f}-{high:.2f}"


_COLUMNS = {
    "this": cell("job_time_s", "{:.3f}"),
    "library": cell("library_time_s", "{:.3f}"),
    "gain": cell("library_gain"),
    "interval": _interval,
    "ids\nequal": cell("ids_equal", "{:.5f}"),
}
