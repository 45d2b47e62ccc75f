"""Terminal output of a moving camera."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.methods.naming import say_split
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import best_by_kind, plain, times

_LEFT = ("scene", "method")
_RATIOS = {
    "over the same eye": "moving_over_still",
    "vs packets": "speedup_vs_packets",
    "vs packets, kept": "speedup_vs_kept_packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The best split of each scene and kind of method. rows: measured, of this workload."""
    best = Table(title="a camera that moves: best split of each scene", title_justify="left")
    for name in (*_LEFT, "frame", *_RATIOS, "pixels wrong"):
        best.add_column(name, justify="left" if name in _LEFT else "right")
    for kind, row, some in best_by_kind(rows):
        wrong, method = str(some["pixels_wrong"].sum()), plain(*filter(None, [kind, say_split(row)]))
        best.add_row(plain(row["scene"]), method, say_ms(row["render_time_s"]), *times(row, *_RATIOS.values()), wrong)
    yield best
