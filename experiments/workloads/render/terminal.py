"""What the terminal says of pictures: where their time goes, and what a faster primary visibility saves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.methods.naming import say_kind
from experiments.workloads.best_splits import rows_by_kind
from experiments.workloads.ratios import best_rows
from experiments.workloads.resources import say_ms
from experiments.workloads.screen import narrow_table

_NUMBERS = ("a\nsample", "primary", "outside\nEmbree", "single\nrays", "packets", "by\nAmdahl", "paid back\nafter")


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line for each scene, kind of picture and method, at its best split. rows: measured, of this workload."""
    table = narrow_table("pictures: time of a sample, and gain over single rays and packets", "scene, method", _NUMBERS)
    for kind, some in rows_by_kind(rows):
        row = best_rows(some).iloc[0]
        table.add_row(
            escape(printable(f"{row['scene']}, {kind}")),
            say_ms(row["render_time_s"] / row["samples"]),
            f"{row['primary_time_s'] / row['render_time_s']:.0%}",
            "" if pd.isna(row["outside_embree"]) else f"{row['outside_embree']:.0%}",
            *(f"{row[name]:.2f}x" for name in ("speedup", "speedup_vs_packets", "speedup_forecast")),
            say_break_even(row["break_even_subframes"]),
        )
    yield table
    yield from _still(rows)
    for _, row in rows[rows["samples_vs_mitsuba"].notna()].iterrows():
        yield f"{row['scene']}, {say_kind(row)}: {row['samples_vs_mitsuba']:.2f} samples for each of Mitsuba 3's"


def say_break_even(samples: Any) -> str:
    """After how many samples planning and building are paid back, in words."""
    return "never" if pd.isna(samples) else f"{int(samples)} samples" if samples > 1 else "1 sample"


def _still(rows: pd.DataFrame) -> Iterator[str]:
    still = rows[rows["jitter"].eq("off")]
    if len(still):
        gains = still["speedup_vs_packets"]
        yield (
            "camera still, no jitter: what is seen is found once and kept, so that no method is faster than one that "
            f"is kept: gains over packets {gains.min():.2f}x to {gains.max():.2f}x"
        )
