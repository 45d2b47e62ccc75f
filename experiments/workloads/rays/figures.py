"""Figures of ray classification: steps over those from the root, against one setting at a time."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.style import BLUE, DASHED, DOTTED, GREY, ORANGE, VERMILLION
from experiments.drawing.values import numbers
from experiments.results.table import workload_rows
from experiments.workloads.panels import make_panels, panels_figure
from experiments.workloads.rays import RAYS, Kind
from experiments.workloads.rays.claims import usual

_STYLES = {
    Kind.primary.value: (BLUE, "o", "solid"),
    Kind.occlusion.value: (ORANGE, "s", DASHED),
    Kind.diffuse.value: (VERMILLION, "^", DOTTED),
}
"""Colour, marker and dash of each kind of rays."""

_SETTINGS = {"shaft_probability": "probability from which a node is opened", "shafts": "shafts"}
_OPTIONS = {"shaft_probability": ("shaft_probability",), "shafts": ("shaft_cells", "shaft_directions")}


def _over(setting: str, table: pd.DataFrame) -> pd.DataFrame:
    """The rows with default options but for those that make the setting, if it has three values or more."""
    changes = dict.fromkeys(_OPTIONS[setting], any)
    rows = usual(workload_rows(table, RAYS.name), **changes)
    return rows[:0] if rows.empty or rows[setting].nunique() < 3 else rows


def draw(rows: pd.DataFrame, columns: int, setting: str) -> Figure:
    """A panel a scene: steps over those from the root, a line for each kind of rays, and of each number of
    directions."""
    panels = make_panels(rows, ("ray_kind", *_OPTIONS[setting]))
    draw_panel = partial(_draw_panel, setting=setting)
    return panels_figure(panels, draw_panel, columns, rows, "1: as many steps as from the root", legend=list(_STYLES))


def _draw_panel(axis: Axes, rows: pd.DataFrame, setting: str) -> None:
    for kind, (color, marker, dash) in _STYLES.items():
        of_kind = rows[rows["ray_kind"].eq(kind)]
        if of_kind.empty:
            continue
        lines = of_kind.groupby("shaft_directions") if setting == "shafts" else [("", of_kind)]
        for place, (_, line) in enumerate(lines):
            x, y = numbers(line, setting), numbers(line, "steps_ratio")
            order = np.argsort(x)
            label = kind if place == 0 else "_nolegend_"
            axis.plot(x[order], y[order], color=color, marker=marker, linestyle=dash, label=label)
    axis.axhline(1.0, color=GREY, linewidth=1)
    axis.set_xlabel(_SETTINGS[setting])
    axis.set_ylabel("steps / those from the root")
    axis.set_ylim(bottom=0)
    if setting == "shafts":
        axis.set_xscale("log")


FIGURES = (
    FigureKind(
        "classification_probability", "Steps of classified rays over the probability from which nodes are opened",
        partial(_over, "shaft_probability"), of_table(partial(draw, setting="shaft_probability")),
    ),
    FigureKind(
        "classification_shafts", "Steps of classified rays over the number of shafts; a line for each number of "
        "directions", partial(_over, "shafts"), of_table(partial(draw, setting="shafts")),
    ),
)  # fmt: skip
