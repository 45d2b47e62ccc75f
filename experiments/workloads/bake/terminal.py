"""What the terminal says of lightmaps."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.results.claims import NOT_MEASURED, judge_claim
from experiments.workloads.bake.claims import CLAIMS
from experiments.workloads.points_table import points_table

_COLUMNS = {
    "rays/s": ("rays_per_s", "{:.3g}"),
    "lanes\nused": ("lane_utilisation", "{:.0%}"),
    "vs\nother": ("speedup_vs_other", "{:.2f}x"),
    "time to\nerror": ("quality_vs_other", "{:.2f}x"),
    "seen\nsooner": ("view_speedup", "{:.2f}x"),
    "whole\nmap": ("whole_map_cost", "{:.2f}x"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line a point, then what became of each claim that was measured. rows: those of this workload that were
    measured."""
    yield points_table("lightmaps", rows, _COLUMNS)
    for claim in CLAIMS:
        for judged in judge_claim(claim, rows):
            if judged.verdict != NOT_MEASURED:
                told = ", ".join(filter(None, [judged.value, judged.why]))
                yield f"{claim.text} {judged.verdict}{f' ({told})' if told else ''}"
