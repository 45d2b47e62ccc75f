"""Terminal output of several frames together."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.methods.naming import best_of
from experiments.results.settings import settings_that_vary
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import best_rows_by, grid_of, narrow_table, plain, times, varying_words

_RATIOS = {
    "frame\nby frame": "speedup_vs_separate",
    "visible-\nfirst": "speedup_vs_visible_first",
    "raster-\niser": "speedup_vs_rasteriser",
    "packets": "speedup_vs_packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The split with the largest gain over packets, and all gains there. rows: measured, of this workload."""
    headings = ("split", "all\nframes", *_RATIOS, "pixels\nwrong")
    best = narrow_table("best split of all frames together, and speed-up over", "scene, frames", headings)
    varying = settings_that_vary(rows, (*best_of(), "motion", "frames"))
    words = [[row["motion"], *varying_words(row, varying)] for _, row in rows.iterrows()]
    for motion, row, some in best_rows_by(rows, words, "frames"):
        best.add_row(
            plain(row["scene"], f"{row['frames']} frames", motion), grid_of(row), say_ms(row["render_time_s"]),
            *times(row, *_RATIOS.values()), str(some["pixels_wrong"].sum()),
        )  # fmt: skip
    yield best
