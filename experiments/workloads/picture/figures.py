"""Figures of shaded pictures."""

from __future__ import annotations

from experiments.drawing.figure import FigureKind
from experiments.results.table import workload_rows
from experiments.workloads.picture import PICTURE
from experiments.workloads.picture.pictures import read_pictures
from experiments.workloads.picture.scenes_figure import draw_scenes_figure

_CAPTION = "Figure 3: the scenes, shaded from aligned hits and from single rays per pixel, and their difference"

FIGURES = (
    FigureKind(
        "figure3",
        _CAPTION,
        lambda table: workload_rows(table, PICTURE.name),
        lambda rows, records: draw_scenes_figure(read_pictures(rows, records)),
        in_page=False,
    ),
)
