"""Terminal output of aligned rays of a bake."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.workloads.bake_rays.claims import CLAIMS
from experiments.workloads.tables import claim_lines, points_table

_COLUMNS = {
    "aligned\nms": ("aligned_time_ms", "{:,.1f}"),
    "vs\nsingle": ("single_over_aligned", "{:.2f}x"),
    "vs\npackets": ("packets_over_aligned", "{:.2f}x"),
    "other\nrays": ("rays_different", "{}"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line a point, then the verdict on each prediction. rows: measured, of this workload."""
    milliseconds = rows.assign(aligned_time_ms=rows["aligned_time_s"] * 1e3)
    yield points_table("aligned rays of a bake, plan and build included", milliseconds, _COLUMNS)
    yield from claim_lines(CLAIMS, rows)
