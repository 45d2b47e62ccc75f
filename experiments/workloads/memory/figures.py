"""Figures of this workload."""

from __future__ import annotations

from experiments.drawing.figure import FigureKind, of_table
from experiments.results.table import workload_rows
from experiments.workloads.memory import MEMORY
from experiments.workloads.memory.memory_figure import draw_memory_figure

FIGURES = (
    FigureKind(
        "figure7",
        "Figure 7: memory over horizontal splits, culling on",
        lambda table: workload_rows(table, MEMORY.name),
        of_table(draw_memory_figure),
    ),
)
