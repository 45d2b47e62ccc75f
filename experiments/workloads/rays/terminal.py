"""Terminal output of batches of rays."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.drawing.values import say_number
from experiments.methods.naming import best_of, say_kind
from experiments.results.settings import settings_that_vary
from experiments.workloads.resources import say_ms
from experiments.workloads.tables import narrow_table, plain, varying_words

_NUMBERS = {
    "steps_ratio": "steps /\nfrom root",
    "speedup_vs_bvh": "from\nroot",
    "speedup": "single\nrays",
    "speedup_vs_packets": "packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    title = "steps, and speed-up over the same rays from the root, and over single rays and packets of Embree"
    table = narrow_table(title, "scene, rays, method", ("batch", *_NUMBERS.values()))
    varying = settings_that_vary(rows, (*best_of(), "packet_width", "ray_kind"))
    for _, row in rows.iterrows():
        name = plain(row["scene"], row["ray_kind"], say_kind(row), *varying_words(row, varying))
        numbers = ("" if pd.isna(row[column]) else say_number(row[column]) for column in _NUMBERS)
        table.add_row(name, say_ms(row["render_time_s"]), *numbers)
    yield table
