"""Terminal output of gathering all hits."""

from __future__ import annotations

import pandas as pd
from rich.table import Table

from experiments.workloads.tables import best_split_table


def sweep_lines(rows: pd.DataFrame) -> list[Table]:
    """The best splits. rows: measured, of this workload."""
    return [best_split_table(rows, "pixels_different")]
