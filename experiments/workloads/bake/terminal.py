"""Terminal output of lightmaps."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.results.claims import NOT_MEASURED
from experiments.workloads.bake.claims import CLAIMS
from experiments.workloads.tables import claim_lines, points_table

_COLUMNS = {
    "rays/s": ("rays_per_s", "{:.3g}"),
    "lanes\nused": ("lane_utilisation", "{:.0%}"),
    "vs\nother": ("speedup_vs_other", "{:.2f}x"),
    "time to\nerror": ("quality_vs_other", "{:.2f}x"),
    "seen\nsooner": ("view_speedup", "{:.2f}x"),
    "whole\nmap": ("whole_map_cost", "{:.2f}x"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line a point, then the verdict on each claim that was measured. rows: measured, of this workload."""
    yield points_table("lightmaps", rows, _COLUMNS)
    yield from claim_lines(CLAIMS, rows, but=[NOT_MEASURED])
