"""Figures of this workload."""

from __future__ import annotations

from experiments.drawing.figure import FigureKind, of_table
from experiments.results.table import workload_rows
from experiments.workloads.agreement import AGREEMENT
from experiments.workloads.agreement.agreement_figure import draw_agreement_figure

FIGURES = (
    FigureKind(
        "agreement",
        "Who is wrong, by float64, where a method and single rays per pixel differ",
        lambda table: workload_rows(table, AGREEMENT.name),
        of_table(draw_agreement_figure),
    ),
)
