"""What the terminal says of batches of rays."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.drawing.values import say_number
from experiments.methods.naming import best_of, say_kind
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads.resources import say_ms
from experiments.workloads.screen import narrow_table

_NUMBERS = {
    "steps_ratio": "steps /\nfrom root",
    "speedup_vs_bvh": "from\nroot",
    "speedup": "single\nrays",
    "speedup_vs_packets": "packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: those of this workload that were measured."""
    title = "steps, and speed-up over the same rays from the root, and over single rays and packets of Embree"
    table = narrow_table(title, "scene, rays, method", ("batch", *_NUMBERS.values()))
    varying = settings_that_vary(rows, (*best_of(), "packet_width", "ray_kind"))
    for _, row in rows.iterrows():
        told = (row["scene"], row["ray_kind"], say_kind(row), *(say_setting(name, row[name]) for name in varying))
        name = escape(printable(", ".join(map(str, told))))
        numbers = ("" if pd.isna(row[column]) else say_number(row[column]) for column in _NUMBERS)
        table.add_row(name, say_ms(row["render_time_s"]), *numbers)
    yield table
