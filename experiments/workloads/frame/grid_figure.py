"""Figure 4 of the paper: speed-up over both axes' splits, one heat map a scene."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from experiments.drawing.pages import add_legend, write_foot
from experiments.drawing.style import DASHED, GREY, PURPLE, SMALL, TIMES, VERMILLION
from experiments.drawing.values import MILLISECONDS, drawable, numbers, say_number
from experiments.methods.aligned_forms import aligned_rows
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import best_rows, own_ratio, say_baseline

_BEST, _START = "best split", f"baseline that gathers all hits: 1 {TIMES} 1"


def draw_grid_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies): in each cell the ratio within rounds, single
    rays over rtcIntersect1 and packets over packets, below it the time. Framed: the best, and the split that splits
    nothing, which is the baseline if the paper's gathers all hits.

    A split without a ratio stays empty, marked with its status. Colours are per scene: compare within a panel.
    """
    aligned = aligned_rows(table)
    # A panel without any ratio would be empty; its points are in the table with their reasons.
    panels = [panel for panel in make_panels(aligned, ("split_x", "split_y")) if drawable(_ratios(panel.rows)).any()]
    figure, axes = draw_panels(panels, _draw_panel, columns, height=4.7)
    add_legend(figure, axes, [_BEST, _START])
    write_foot(figure, table, "below each ratio: ms; 1 is the baseline that finds the nearest hit, per pixel")
    return figure


def _ratios(rows: pd.DataFrame) -> np.ndarray:
    """(N,) float64."""
    return numbers(rows, own_ratio(rows))


def _draw_panel(axis: Axes, points: pd.DataFrame) -> None:
    splits_x = sorted(int(split) for split in points["split_x"].unique())
    splits_y = sorted(int(split) for split in points["split_y"].unique())
    ratios = np.full((len(splits_y), len(splits_x)), np.nan)
    values = _ratios(points)
    middle = np.sqrt(np.nanmin(values) * np.nanmax(values))
    times_ms = numbers(points, "render_time_s") * MILLISECONDS
    for (_, point), value, time_ms in zip(points.iterrows(), values, times_ms, strict=True):
        row, column = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
        if drawable(value):
            ratios[row, column] = value
            text, color = f"{value:.2f}{TIMES}\n{say_number(time_ms)}", "white" if value > middle else "black"
        else:
            text, color = "no ratio" if point["status"] == "ok" else str(point["status"]), GREY
        axis.text(column, row, text, ha="center", va="center", fontsize=SMALL, color=color)
    low, high = np.nanmin(ratios), np.nanmax(ratios)
    picture = axis.imshow(ratios, origin="lower", cmap="cividis_r", norm=LogNorm(low, max(high, low * 1.01)))
    best = best_rows(points).iloc[0]
    for split, label, style in (
        ((1, 1), _START, {"edgecolor": PURPLE, "linestyle": DASHED}),
        ((best["split_x"], best["split_y"]), _BEST, {"edgecolor": VERMILLION}),
    ):
        if split[0] in splits_x and split[1] in splits_y:
            corner = (splits_x.index(split[0]) - 0.46, splits_y.index(split[1]) - 0.46)
            axis.add_patch(Rectangle(corner, 0.92, 0.92, fill=False, linewidth=2.5, label=label, **style))
    axis.set_xticks(range(len(splits_x)), [str(split) for split in splits_x])
    axis.set_yticks(range(len(splits_y)), [str(split) for split in splits_y])
    axis.set_xlabel("horizontal splits")
    axis.set_ylabel("vertical splits")
    # One value alone has no scale.
    if high > low * 1.01:
        ticks = np.geomspace(low, high, 4)
        over = f"speed-up over {say_baseline(own_ratio(points))}"
        bar = axis.figure.colorbar(picture, ax=axis, shrink=0.85, label=over)
        bar.set_ticks(ticks.tolist(), labels=[f"{tick:.2f}" for tick in ticks])
        bar.minorticks_off()
