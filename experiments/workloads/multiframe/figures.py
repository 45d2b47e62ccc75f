"""Figures of several frames."""

from __future__ import annotations

import pandas as pd

from experiments.drawing.figure import FigureKind, of_table
from experiments.results.table import workload_rows
from experiments.workloads.multiframe import MULTIFRAME, Motion
from experiments.workloads.multiframe.multiframe_figure import draw_multiframe_figure
from experiments.workloads.multiframe.stereo_figure import draw_stereo_figure


def _rows(table: pd.DataFrame, eyes: bool) -> pd.DataFrame:
    rows = workload_rows(table, MULTIFRAME.name)
    return rows[rows["motion"].eq(Motion.eyes.value).fillna(False).astype(bool) == eyes]


FIGURES = (
    FigureKind(
        "stereo", "Time of the images of both eyes, together and eye by eye", lambda table: _rows(table, eyes=True),
        of_table(draw_stereo_figure),
    ),
    FigureKind(
        "multiframe", "Time per frame and memory over the number of frames, together and frame by frame",
        lambda table: _rows(table, eyes=False), of_table(draw_multiframe_figure),
    ),
)  # fmt: skip
