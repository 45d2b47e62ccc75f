"""What the terminal says of frame times."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from rich.table import Table

from experiments.workloads.best_splits import best_split_table
from experiments.workloads.frame.best_baseline import baseline_lines
from experiments.workloads.frame.growth import growth_lines
from experiments.workloads.frame.robust_price import price_lines


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """The best splits, how times grow, where triangles or pixels do, and the price of Embree's robust setting, where
    both were measured. rows: those of this workload that were measured."""
    yield best_split_table(rows, "pixels_wrong")
    yield from growth_lines(rows)
    yield from price_lines(rows)


def process_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Which packets per pixel are the fastest, where several were tried. rows: of every process that measured."""
    yield from baseline_lines(rows)
