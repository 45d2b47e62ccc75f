"""Figure 5 of the paper: render time over the splits of one axis, culling off and on, against both baselines."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_baseline, draw_series, finish_split_axes
from experiments.drawing.missing import Missing, mark_missing, without_value
from experiments.drawing.pages import add_legend, write_foot
from experiments.drawing.values import MILLISECONDS, TIMES, drawable, numbers, quartiles_ms
from experiments.methods.aligned_forms import COPIED_OFF, FORM_OPTIONS, FORM_STYLES, aligned_forms, aligned_rows
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import draw_panels, make_panels


def draw_split_figure(table: pd.DataFrame, axis_name: str = "split_x") -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds over splits, both logarithmic.

    axis_name: the column on the abscissa, `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical).
    Points are medians with bars from the lower to the upper quartile over rounds. A baseline is measured again with
    every point: its line is the median over all of them, its band reaches from lower to upper quartile.
    """
    panels = make_panels(aligned_rows(table), (axis_name, *FORM_OPTIONS))
    figure, axes = draw_panels(panels, partial(draw_times, axis_name=axis_name))
    add_legend(figure, axes, [*FORM_STYLES, *TIME_BASELINES])
    write_foot(figure, table, mark="in bold: speed-up over rtcIntersect1 at the shortest time")
    return figure


def draw_times(axis: Axes, rows: pd.DataFrame, axis_name: str, mark_best: bool = True) -> None:
    """Frame times of one panel's aligned rows, each form of the geometry a line, with both baselines.

    mark_best: write the speed-up at the shortest time of each line.
    """
    missing: list[Missing] = []
    for form, points in aligned_forms(rows).items():
        style = FORM_STYLES[form]
        time_ms, *quartiles = quartiles_ms(points, "render_time")
        draw_series(axis, numbers(points, axis_name), time_ms, style, quartiles, form)
        if mark_best:
            _mark_best(axis, points, time_ms, axis_name, form)
        missing += without_value(points, time_ms, axis_name, form.removeprefix("aligned, "), style["color"])
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
