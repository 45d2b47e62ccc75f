"""Figures of this workload."""

from __future__ import annotations

from experiments.drawing.figure import FigureKind, of_table
from experiments.results.table import workload_rows
from experiments.workloads.build import BUILD
from experiments.workloads.build.build_figure import draw_build_figure

FIGURES = (
    FigureKind(
        "figure6",
        "Figure 6: plan and BVH build over horizontal splits, culling on",
        lambda table: workload_rows(table, BUILD.name),
        of_table(draw_build_figure),
    ),
)
