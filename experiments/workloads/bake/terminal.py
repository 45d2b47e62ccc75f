"""What the terminal says of lightmaps."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.workloads.points_table import points_table

_COLUMNS = {
    "rays/s": ("rays_per_s", "{:.3g}"),
    "lanes\nused": ("lane_utilisation", "{:.0%}"),
    "vs all\nlanes": ("speedup_vs_all_lanes", "{:.2f}x"),
    "seen\nsooner": ("view_speedup", "{:.2f}x"),
    "whole\nmap": ("whole_map_cost", "{:.2f}x"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: those of this workload that were measured."""
    yield points_table("lightmaps", rows, _COLUMNS)
