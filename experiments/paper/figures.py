"""Figures of the paper that draw several workloads."""

from __future__ import annotations

import pandas as pd

from experiments.drawing.figure import FigureKind, of_table
from experiments.methods.aligned_forms import INSTANCED, aligned_forms
from experiments.paper.instancing_figure import draw_instancing_figure
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.memory import MEMORY


def _instances(table: pd.DataFrame) -> pd.DataFrame:
    memory = workload_rows(table, MEMORY.name)
    return workload_rows(table, MEMORY.name, FRAME.name) if INSTANCED in aligned_forms(memory) else table[:0]


FIGURES = (
    FigureKind(
        "figure7_instancing", "Beside figure 7: instances instead of copies, in memory and in time", _instances,
        of_table(draw_instancing_figure),
    ),
)  # fmt: skip
