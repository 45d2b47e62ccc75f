"""Figure 5 of the paper: speed-up over the splits of one axis, culling off and on, against both baselines."""

from __future__ import annotations

from functools import partial
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_series, finish_split_axes
from experiments.drawing.missing import Missing, mark_missing, without_value
from experiments.drawing.pages import add_legend, write_foot, write_lines
from experiments.drawing.style import DASH_DOTTED, GREY, TIMES
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.methods.aligned_forms import (
    COPIED_OFF,
    FORM_OPTIONS,
    FORM_STYLES,
    aligned_forms,
    aligned_rows,
)
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import best_rows, draw_ratio_baselines, own_ratio, say_baseline

ALL_HITS = f"1 {TIMES} 1, culling off: all hits"
"""The paper's other possible baseline: the method with nothing to align."""

RATIO_LABELS = (*FORM_STYLES, *TIME_BASELINES, ALL_HITS)
"""In the order of the legends."""

_RING: dict[str, Any] = {
    "markersize": 13,
    "markerfacecolor": "none",
    "markeredgewidth": 1.8,
    "zorder": 4,
    "label": "_best",
}
"""Around the best split: a number there would lie over the lines, and stands below."""


def draw_split_figure(table: pd.DataFrame, columns: int = 2, axis_name: str = "split_x") -> Figure:
    """One panel a scene (and a value of any other setting that varies); speed-up over splits, both logarithmic.

    axis_name: the column on the abscissa, `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical).
    Points are ratios within rounds, single rays over rtcIntersect1 and packets over packets, with bars over their
    intervals. A line at another height is another baseline, which makes the distance to it the gain over that one.
    """
    panels = make_panels(aligned_rows(table), (axis_name, *FORM_OPTIONS))
    figure, axes = draw_panels(panels, partial(draw_ratios, axis_name=axis_name), columns)
    add_legend(figure, axes, RATIO_LABELS)
    write_foot(figure, table, "ringed, and in words below: the best split")
    return figure


def draw_ratios(axis: Axes, rows: pd.DataFrame, axis_name: str) -> None:
    """Ratios of one panel's aligned rows, each form of the geometry a line, with the baselines."""
    missing: list[Missing] = []
    ratio, lines = own_ratio(rows), []
    gathering = rows[rows["split_x"].eq(1) & rows["split_y"].eq(1) & ~rows["culling"].fillna(True)]
    all_hits = numbers(aligned_forms(gathering).get(COPIED_OFF, rows[:0]), ratio)
    for form, points in aligned_forms(rows).items():
        style, short = FORM_STYLES[form], form.removeprefix("aligned, ")
        value, *interval = (numbers(points, f"{ratio}{end}") for end in ("", "_low", "_high"))
        draw_series(axis, numbers(points, axis_name), value, style, interval, form)
        missing += without_value(points, value, axis_name, short, style["color"])
        for _, best in best_rows(points).iterrows():
            axis.plot(best[axis_name], best[ratio], "o", **_RING, markeredgecolor=style["color"])
            over = "".join(f"; over all hits {best[ratio] / start:.2f}{TIMES}" for start in all_hits)
            time_ms = say_number(best["render_time_s"] * MILLISECONDS)
            lines.append(
                (style["color"], [f"{short}: {best[axis_name]} best, {time_ms} ms, {best[ratio]:.2f}{TIMES}{over}"])
            )
    draw_ratio_baselines(axis, rows, ratio)
    for start in all_hits:
        axis.axhline(start, color=GREY, linestyle=DASH_DOTTED, linewidth=1.5, zorder=2, label=ALL_HITS)
    mark_missing(axis, missing, write_lines(axis, lines))
    finish_split_axes(axis, rows[axis_name], axis_name, f"speed-up over {say_baseline(ratio)}")
