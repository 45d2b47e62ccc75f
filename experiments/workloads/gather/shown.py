"""What is shown of gathering all hits."""

from __future__ import annotations

import pandas as pd
from rich.table import Table

from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.values import varies
from experiments.methods.naming import aligned_rows
from experiments.results.table import workload_rows
from experiments.workloads.frame_figures import draw_methods_figure, draw_split_ratios
from experiments.workloads.gather import GATHER
from experiments.workloads.tables import best_split_table


def sweep_lines(rows: pd.DataFrame) -> list[Table]:
    """The best splits. rows: measured, of this workload."""
    return [best_split_table(rows, "pixels_different")]


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    return workload_rows(table, GATHER.name)


def _of_methods(table: pd.DataFrame) -> pd.DataFrame:
    rows = _rows(table)
    return rows if varies(rows, "method") else rows[:0]


def _over_splits(table: pd.DataFrame) -> pd.DataFrame:
    rows = aligned_rows(_rows(table))
    return rows if varies(rows, "split_x") else rows[:0]


FIGURES = (
    FigureKind(
        "gather", "All hits: speed-up over packets that gather the same", _of_methods, of_table(draw_methods_figure),
    ),
    FigureKind(
        "figure5_gather", "As figure 5, where every ray gathers all hits: speed-up over horizontal splits",
        _over_splits, of_table(draw_split_ratios), per_packet_width=True,
    ),
)  # fmt: skip
