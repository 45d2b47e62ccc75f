"""Frames of a moving camera, as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import say_split
from experiments.workloads.best_splits import rows_by_kind
from experiments.workloads.ratios import best_rows
from experiments.workloads.resources import say_ms

_LEFT = ("scene", "method")
_RATIOS = {
    "over the same eye": "moving_over_still",
    "vs packets": "speedup_vs_packets",
    "vs packets, kept": "speedup_vs_kept_packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The best split of each scene and kind of method. rows: those of this workload that were measured."""
    best = Table(title="a camera that moves: best split of each scene", title_justify="left")
    for name in (*_LEFT, "frame", *_RATIOS, "pixels wrong"):
        best.add_column(name, justify="left" if name in _LEFT else "right")
    for kind, some in rows_by_kind(rows):
        row = best_rows(some).iloc[0]
        best.add_row(
            escape(printable(str(row["scene"]))),
            escape(printable(", ".join(filter(None, [kind, say_split(row)])))),
            say_ms(row["render_time_s"]),
            *(f"{row[name]:.2f}x" for name in _RATIOS.values()),
            str(some["pixels_wrong"].sum()),
        )
    yield best
