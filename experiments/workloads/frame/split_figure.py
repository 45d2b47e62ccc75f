"""Figure 5 of the paper: render time over the splits of one axis, culling off and on, against both baselines."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_baseline, draw_series, finish_split_axes
from experiments.drawing.missing import Missing, mark_missing, missing_points, undrawable_points
from experiments.drawing.pages import add_foot, add_legend, make_figure, set_panel_title
from experiments.drawing.values import MILLISECONDS, TIMES, drawable, numbers
from experiments.methods.aligned_forms import COPIED_OFF, FORM_OPTIONS, FORM_STYLES, aligned_forms, aligned_rows
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import panels_over_splits


def draw_split_figure(table: pd.DataFrame, axis_name: str = "split_x", heading: str = "") -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds over splits, both logarithmic.

    axis_name: the column on the abscissa, `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical).
    heading: stands above the figure, for one that belongs to a row of figures.
    Points are medians with bars from the lower to the upper quartile over rounds. A baseline is measured again with
    every point: its line is the median over all of them, its band reaches from lower to upper quartile.
    """
    aligned = aligned_rows(table)
    panels = panels_over_splits(aligned, FORM_OPTIONS, axis_name)
    figure, axes = make_figure(len(panels))
    for axis, panel in zip(axes, panels, strict=True):
        set_panel_title(axis, panel.title, panel.stands_for)
        draw_times(axis, panel.rows, axis_name)
    add_legend(figure, axes, [*FORM_STYLES, *TIME_BASELINES], heading)
    add_foot(figure, table, "in bold: speed-up over rtcIntersect1 at the shortest time")
    return figure


def draw_times(axis: Axes, rows: pd.DataFrame, axis_name: str, mark_best: bool = True) -> None:
    """Frame times of one panel's aligned rows, each form of the geometry a line, with both baselines.

    mark_best: write the speed-up at the shortest time of each line.
    """
    missing: list[Missing] = []
    for form, points in aligned_forms(rows).items():
        style = FORM_STYLES[form]
        time_ms, q1_ms, q3_ms = (
            numbers(points, name) * MILLISECONDS for name in ("render_time_s", "render_time_q1_s", "render_time_q3_s")
        )
        draw_series(axis, numbers(points, axis_name), time_ms, style, (q1_ms, q3_ms), form)
        if mark_best:
            _mark_best(axis, points, time_ms, axis_name, form)
        missing += missing_points(points, axis_name, form.removeprefix("aligned, "), style["color"])
        missing += undrawable_points(points, time_ms, axis_name, form.removeprefix("aligned, "), style["color"])
    for label, (name, style) in TIME_BASELINES.items():
        draw_baseline(axis, numbers(rows, name) * MILLISECONDS, style, label)
    mark_missing(axis, missing)
    finish_split_axes(axis, rows[axis_name], axis_name, "time per frame in ms")


def _mark_best(axis: Axes, points: pd.DataFrame, time_ms: np.ndarray, axis_name: str, form: str) -> None:
    if not drawable(time_ms).any():
        return
    best = int(np.nanargmin(np.where(drawable(time_ms), time_ms, np.nan)))
    speedup = numbers(points, "speedup")[best]
    if not np.isfinite(speedup):
        return
    axis.annotate(
        f"{speedup:.2f}{TIMES}",
        (numbers(points, axis_name)[best], time_ms[best]),
        xytext=(0, 8 if form == COPIED_OFF else -13), textcoords="offset points", ha="center", fontsize=8.5,
        color=FORM_STYLES[form]["color"], fontweight="bold",
        bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}, zorder=4,
    )  # fmt: skip
