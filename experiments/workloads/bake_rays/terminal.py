"""What the terminal says of aligned rays of a bake."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.results.claims import judge_claim
from experiments.workloads.bake_rays.claims import CLAIMS
from experiments.workloads.points_table import points_table

_COLUMNS = {
    "aligned\nms": ("aligned_time_ms", "{:,.1f}"),
    "vs\nsingle": ("single_over_aligned", "{:.2f}x"),
    "vs\npackets": ("packets_over_aligned", "{:.2f}x"),
    "other\nrays": ("rays_different", "{}"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line a point, then what became of each prediction. rows: those of this workload that were measured."""
    times = rows.assign(aligned_time_ms=rows["aligned_time_s"] * 1e3)
    yield points_table("aligned rays of a bake, plan and build included", times, _COLUMNS)
    for claim in CLAIMS:
        for judged in judge_claim(claim, rows):
            told = ", ".join(filter(None, [judged.value, judged.why]))
            yield f"{claim.text} {judged.verdict}{f' ({told})' if told else ''}"
