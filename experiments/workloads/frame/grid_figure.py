"""Figure 4 of the paper: render time over both axes' splits, one heat map a scene."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from experiments.drawing.pages import write_foot
from experiments.drawing.style import GREY, VERMILLION
from experiments.drawing.values import MILLISECONDS, drawable, numbers
from experiments.methods.aligned_forms import aligned_rows
from experiments.workloads.panels import draw_panels, make_panels


def draw_grid_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies): milliseconds in each cell, the best framed.

    A split without a time stays empty, marked with its status. Colours are per scene: compare within a panel.
    """
    aligned = aligned_rows(table)
    # A panel without any time would be empty; its points are in the table with their reasons.
    panels = [panel for panel in make_panels(aligned, ("split_x", "split_y")) if drawable(_times(panel.rows)).any()]
    figure, _ = draw_panels(panels, _draw_panel, height=4.7)
    figure.suptitle("", fontsize=12)
    write_foot(figure, table, mark="shortest time framed")
    return figure


def _times(rows: pd.DataFrame) -> np.ndarray:
    """(N,) float64 ms."""
    return numbers(rows, "render_time_s") * MILLISECONDS


def _draw_panel(axis: Axes, points: pd.DataFrame) -> None:
    splits_x = sorted(int(split) for split in points["split_x"].unique())
    splits_y = sorted(int(split) for split in points["split_y"].unique())
    time_ms = np.full((len(splits_y), len(splits_x)), np.nan)
    for (_, point), value in zip(points.iterrows(), _times(points), strict=True):
        row, column = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
        if drawable(value):
            time_ms[row, column] = value
        else:
            status = "no time" if point["status"] == "ok" else point["status"]
            axis.text(column, row, status, ha="center", va="center", fontsize=7, color=GREY)
    low, high = np.nanmin(time_ms), np.nanmax(time_ms)
    picture = axis.imshow(time_ms, origin="lower", cmap="cividis_r", norm=LogNorm(low, max(high, low * 1.01)))
    middle = np.sqrt(low * high)
    for row, column in np.argwhere(np.isfinite(time_ms)):
        value = time_ms[row, column]
        color = "white" if value > middle else "black"
        axis.text(column, row, _short(value), ha="center", va="center", fontsize=9, color=color)
    best_row, best_column = np.unravel_index(np.nanargmin(time_ms), time_ms.shape)
    corner = (float(best_column) - 0.5, float(best_row) - 0.5)
    axis.add_patch(Rectangle(corner, 1, 1, fill=False, edgecolor=VERMILLION, linewidth=2.5))
    axis.set_xticks(range(len(splits_x)), [str(split) for split in splits_x])
    axis.set_yticks(range(len(splits_y)), [str(split) for split in splits_y])
    axis.set_xlabel("horizontal splits")
    axis.set_ylabel("vertical splits")
    # One value alone has no scale.
    if high > low * 1.01:
        ticks = np.geomspace(low, high, 4)
        bar = axis.figure.colorbar(picture, ax=axis, shrink=0.85, label="time per frame in ms")
        bar.set_ticks(ticks.tolist(), labels=[_short(tick) for tick in ticks])
        bar.minorticks_off()


def _short(time_ms: float) -> str:
    return f"{time_ms:.0f}" if time_ms >= 100 else f"{time_ms:.3g}"
