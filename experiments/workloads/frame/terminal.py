"""Best splits of frame times, as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import TIMES, best_of, say_kind, say_split
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.frame.best_baseline import baseline_lines
from experiments.workloads.frame.growth import growth_lines
from experiments.workloads.ratios import best_rows
from experiments.workloads.resources import say_ms
from experiments.workloads.screen import narrow_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """The best split of each scene, kind of method and packet width, with all that is wrong over the splits; and how
    times grow, where triangles or pixels do. rows: those of this workload that were measured."""
    numbers = ("packets\nof", "split", "frame", "single\nrays", "packets", "pixels\nwrong")
    best = narrow_table("best split of each scene, and speed-up over single rays and packets", "scene, method", numbers)
    varying = settings_that_vary(rows, (*best_of(), "packet_width"))
    kinds = pd.Series(
        [", ".join([say_kind(row), *(say_setting(name, row[name]) for name in varying)]) for _, row in rows.iterrows()],
        index=rows.index,
        dtype="object",
    )
    for (scene, kind, width), some in rows.groupby(["scene", kinds, "packet_width"], sort=False):
        row = best_rows(some).iloc[0]
        best.add_row(
            escape(printable(f"{scene}, {kind}")),
            str(width),
            say_split(row).partition(",")[0].replace(TIMES, "x"),
            say_ms(row["render_time_s"]),
            f"{row['speedup']:.2f}x",
            f"{row['speedup_vs_packets']:.2f}x",
            str(some["pixels_wrong"].sum()),
        )
    yield best
    yield from growth_lines(rows)


def process_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Which packets per pixel are the fastest, where several were tried. rows: of every process that measured."""
    yield from baseline_lines(rows)
