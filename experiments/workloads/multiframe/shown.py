"""What is shown of several frames: the best split, and how many times as fast they are together."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.methods.naming import best_of
from experiments.results.settings import settings_that_vary
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import best_rows_by, best_table, cell, grid_of, varying_words

_COLUMNS = {
    "split": grid_of,
    "all\nframes": lambda row: say_ms(row["render_time_s"]),
    "frame\nby frame": cell("speedup_vs_separate"),
    "visible-\nfirst": cell("speedup_vs_visible_first"),
    "raster-\niser": cell("speedup_vs_rasteriser"),
    "packets": cell("speedup_vs_packets"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The split with the largest gain over packets, and all gains there. rows: measured, of this workload."""
    varying = settings_that_vary(rows, (*best_of(), "motion", "frames"))
    words = [[row["motion"], *varying_words(row, varying)] for _, row in rows.iterrows()]
    best = (([f"{row['frames']} frames", said], row, some) for said, row, some in best_rows_by(rows, words, "frames"))
    title = "best split of all frames together, and speed-up over"
    yield best_table(title, "scene, frames", best, _COLUMNS, "pixels_wrong")
