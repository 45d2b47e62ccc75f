"""Best splits of several frames together, as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import TIMES, best_of, say_split
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.ratios import best_rows
from experiments.workloads.resources import say_ms
from experiments.workloads.screen import narrow_table

_RATIOS = {
    "frame\nby frame": "speedup_vs_separate",
    "visible-\nfirst": "speedup_vs_visible_first",
    "raster-\niser": "speedup_vs_rasteriser",
    "packets": "speedup_vs_packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The split at which all frames together gain most over packets, and how many times as fast they are there. rows:
    those of this workload that were measured."""
    numbers = ("split", "all\nframes", *_RATIOS, "pixels\nwrong")
    best = narrow_table("best split of all frames together, and speed-up over", "scene, frames", numbers)
    varying = settings_that_vary(rows, (*best_of(), "motion", "frames"))
    motions = pd.Series(
        [", ".join([row["motion"], *(say_setting(name, row[name]) for name in varying)]) for _, row in rows.iterrows()],
        index=rows.index,
        dtype="object",
    )
    for (scene, motion, frames), some in rows.groupby(["scene", motions, "frames"], sort=False):
        row = best_rows(some).iloc[0]
        best.add_row(
            escape(printable(f"{scene}, {frames} frames, {motion}")),
            say_split(row).partition(",")[0].replace(TIMES, "x"),
            say_ms(row["render_time_s"]),
            *(f"{row[name]:.2f}x" for name in _RATIOS.values()),
            str(some["pixels_wrong"].sum()),
        )
    yield best
