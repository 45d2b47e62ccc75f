"""Two eyes: the time of both images, together and eye by eye."""

from __future__ import annotations

from math import nan

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_baseline, say_nothing_measured
from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes, panel_height
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.values import MILLISECONDS, interval_ms, numbers, say_number
from experiments.methods.naming import best_of, say_split
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.multiframe.frame_parts import (
    RASTER_FRAMES,
    SEPARATE_FRAMES,
    TOGETHER,
    VISIBLE_FRAMES,
    Way,
    best_place,
    say_speedup,
)
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.series import say_ratio, say_unmeasured, say_wrong

_LABELS = {
    TOGETHER: "both together", SEPARATE_FRAMES: "aligned, each eye", VISIBLE_FRAMES: "visible-first, each eye",
    RASTER_FRAMES: "rasteriser, each eye",
}  # fmt: skip


def draw_stereo_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies).

    A bar is the time of both images in milliseconds at the way's best split, its whisker the interval. Single rays and
    packets per pixel, eye by eye, are the two lines: the median of the points, with a band from quartile to quartile.
    """
    panels = make_panels(table, (*best_of(), "motion", "frames"))
    figure, axes = draw_panels(panels, _draw_panel, columns, panel_height(len(_LABELS)))
    add_legend(figure, axes, list(TIME_BASELINES))
    write_foot(
        figure, table,
        "right of a label: the time, and over both together at that split: packets (first bar), each eye (the others); "
        "without plan and build",
    )  # fmt: skip
    return figure


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars = [_make_bar(rows, way, label) for way, label in _LABELS.items()]
    draw_bars(axis, bars)
    furthest = max(
        draw_baseline(axis, numbers(rows, name) * MILLISECONDS, style, label, upright=True)
        for label, (name, style) in TIME_BASELINES.items()
    )
    finish_bar_axes(axis, bars, "time of both images in ms", furthest)
    if all(bar.value != bar.value for bar in bars):
        say_nothing_measured(axis)
    write_notes(axis, [*say_wrong(rows, ""), *say_unmeasured(rows, TOGETHER.label)])


def _make_bar(rows: pd.DataFrame, way: Way, label: str) -> Bar:
    place = best_place(rows, way)
    if place is None:
        return Bar(label, nan, nan, nan, way.style["color"], "not measured")
    row = rows.iloc[place]
    value, low, high = (float(ends[place]) for ends in interval_ms(rows, way.time))
    ratio = say_ratio(row) if way is TOGETHER else say_speedup(row, way)
    split = "" if way is RASTER_FRAMES else say_split(row)
    name = ", ".join(filter(None, [label, split]))
    return Bar(name, value, low, high, way.style["color"], f"{say_number(value)} ms, {ratio}")
