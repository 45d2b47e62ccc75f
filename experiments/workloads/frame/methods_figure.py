"""Every method at its best split: time per frame against both baselines."""

from __future__ import annotations

from math import nan

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, draw_upright_lines, finish_bar_axes
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.values import MILLISECONDS, column, quartiles_ms, say_number
from experiments.methods import METHODS
from experiments.methods.naming import best_of, say_series, say_split
from experiments.methods.pixel import PIXEL
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.frame.break_even import best_rows, time_rows
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.series import say_ratio, say_unmeasured, series_of, style_of


def draw_methods_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds from zero.

    A bar is a method and packet width at the split with the largest ratio to packets, its whisker reaches from the
    lower to the upper quartile over rounds. Single rays and the fastest packets per pixel, measured again with every
    point, are the two lines: the median over all points, with a band from lower to upper quartile. Peers are left out.
    """
    rows = time_rows(table)
    rows = rows[rows["method"].isin([method.name for method in METHODS if method.is_ours])]
    panels = make_panels(rows, (*best_of(), "packet_width"))
    figure, axes = draw_panels(panels, _draw_panel, height=3.3)
    add_legend(figure, axes, list(TIME_BASELINES))
    write_foot(figure, rows, "beside a bar: packets / method, [95 % interval of the median]")
    return figure


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars, notes = [], []
    lines = {1, None, *column(rows, "packets_width").dropna()}
    for method, width, points in series_of(rows):
        name = say_series(method, width)
        notes += say_unmeasured(points, name)
        if method != PIXEL.name or width not in lines:
            bars.append(_make_bar(points, name, style_of(method, width)["color"], faint=width == 1))
    draw_bars(axis, bars)
    furthest = draw_upright_lines(axis, rows, TIME_BASELINES, MILLISECONDS)
    finish_bar_axes(axis, bars, "time per frame in ms", furthest)
    write_notes(axis, notes)


def _make_bar(points: pd.DataFrame, name: str, color: str, faint: bool) -> Bar:
    best = best_rows(points)
    if len(best) == 0:
        status = [str(status) for status in points["status"].dropna().unique() if status != "ok"]
        return Bar(name, nan, nan, nan, color, " and ".join(status) or "not measured")
    row = best.iloc[0]
    time_ms, q1_ms, q3_ms = (float(values[0]) for values in quartiles_ms(best, "render_time"))
    label = "\n".join(filter(None, [name, say_split(row)]))
    return Bar(label, time_ms, q1_ms, q3_ms, color, f"{say_number(time_ms)} ms,  {say_ratio(row)}", faint)
