"""Figures of this workload."""

from __future__ import annotations

from experiments.drawing.figure import FigureKind, of_table
from experiments.results.table import workload_rows
from experiments.workloads.planner import PLANNER
from experiments.workloads.planner.planner_figure import draw_planner_figure

FIGURES = (
    FigureKind(
        "planner",
        "Regret of plans against the best of all candidates",
        lambda table: workload_rows(table, PLANNER.name),
        of_table(draw_planner_figure),
    ),
)
