"""What the terminal says of gathering all hits."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.workloads.best_splits import best_split_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The best splits. rows: those of this workload that were measured."""
    yield best_split_table(rows, "pixels_different")
