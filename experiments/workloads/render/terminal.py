"""Terminal output of pictures: where their time goes, and what a faster primary visibility saves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd
from rich.table import Table

from experiments.methods.naming import say_kind
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import best_by_kind, narrow_table, plain, times

_NUMBERS = ("a\nsample", "primary", "outside\nEmbree", "single\nrays", "packets", "by\nAmdahl", "paid back\nafter")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line for each scene, kind of picture and method, at its best split. rows: measured, of this workload."""
    table = narrow_table("pictures: time of a sample, and gain over single rays and packets", "scene, method", _NUMBERS)
    for kind, row, _ in best_by_kind(rows):
        table.add_row(
            plain(row["scene"], kind),
            say_ms(row["render_time_s"] / row["samples"]),
            f"{row['primary_time_s'] / row['render_time_s']:.0%}",
            "" if pd.isna(row["outside_embree"]) else f"{row['outside_embree']:.0%}",
            *times(row, "speedup", "speedup_vs_packets", "speedup_forecast"),
            say_break_even(row["break_even_subframes"]),
        )
    yield table
    still = rows[rows["jitter"].eq("off")]
    if len(still):
        gains = still["speedup_vs_packets"]
        yield (
            "camera still, no jitter: what is seen is found once and kept, so that no method is faster than one that "
            f"is kept: gains over packets {gains.min():.2f}x to {gains.max():.2f}x"
        )
    for _, row in rows[rows["samples_vs_mitsuba"].notna()].iterrows():
        yield f"{row['scene']}, {say_kind(row)}: {row['samples_vs_mitsuba']:.2f} samples for each of Mitsuba 3's"


def say_break_even(samples: Any) -> str:
    """After how many samples planning and building are paid back, in words."""
    return "never" if pd.isna(samples) else f"{int(samples)} samples" if samples > 1 else "1 sample"
