"""Two eyes: the time of both images, together and eye by eye."""

from __future__ import annotations

from math import nan

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import say_nothing_measured
from experiments.drawing.bars import Bar, draw_bars, draw_upright_lines, finish_bar_axes
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.values import MILLISECONDS, say_number
from experiments.methods.naming import best_of, say_split
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.multiframe.frame_parts import (
    SEPARATE_FRAMES,
    TOGETHER,
    VISIBLE_FRAMES,
    Way,
    best_row,
    say_speedup,
)
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.series import say_ratio, say_unmeasured

_LABELS = {
    TOGETHER: "both together", SEPARATE_FRAMES: "aligned\neye by eye", VISIBLE_FRAMES: "visible-first\neye by eye",
}  # fmt: skip


def draw_stereo_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies).

    A bar is the time of both images in milliseconds at the way's best split, its whisker reaches from the lower to the
    upper quartile over rounds. Single rays and packets per pixel, eye by eye, are the two lines: the median over all
    points, with a band from lower to upper quartile.
    """
    panels = make_panels(table, (*best_of(), "motion", "frames"))
    figure, axes = draw_panels(panels, _draw_panel, height=3.0)
    add_legend(figure, axes, list(TIME_BASELINES))
    write_foot(
        figure, table,
        "beside a bar: packets / both together, below it eye by eye / both together at that split, "
        "[95 % interval of the median]; without plan and build",
    )  # fmt: skip
    return figure


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars = [_make_bar(rows, way, label) for way, label in _LABELS.items()]
    draw_bars(axis, bars)
    furthest = draw_upright_lines(axis, rows, TIME_BASELINES, MILLISECONDS)
    finish_bar_axes(axis, bars, "time of both images in ms", furthest)
    if all(bar.value != bar.value for bar in bars):
        say_nothing_measured(axis)
    write_notes(axis, say_unmeasured(rows, TOGETHER.label))


def _make_bar(rows: pd.DataFrame, way: Way, label: str) -> Bar:
    row = best_row(rows, way)
    if row is None:
        return Bar(label, nan, nan, nan, way.style["color"], "not measured")
    value, low, high = (float(row[f"{way.time}{end}_s"]) * MILLISECONDS for end in ("", "_q1", "_q3"))
    ratio = say_ratio(row) if way is TOGETHER else say_speedup(row, way)
    name = ", ".join(filter(None, [label, say_split(row)]))
    return Bar(name, value, low, high, way.style["color"], f"{say_number(value)} ms,  {ratio}")
