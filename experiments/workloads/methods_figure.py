"""Every method at its best split: speed-up over packets."""

from __future__ import annotations

from math import nan

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes, panel_height
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.values import MILLISECONDS, column, numbers, say_number
from experiments.methods import METHODS
from experiments.methods.naming import best_of, say_series, say_split
from experiments.methods.pixel import PIXEL
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import OVER_PACKETS, best_rows, draw_ratio_baselines, say_baseline
from experiments.workloads.series import say_ratio, say_unmeasured, say_wrong, series_of, style_of


def draw_methods_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method and packet width at its best split, its whisker the interval. Single rays and the fastest packets
    per pixel, measured again with every point, are the two lines. Peers are left out.
    """
    rows = table[table["method"].isin([method.name for method in METHODS if method.is_ours])]
    panels = make_panels(rows, (*best_of(), "packet_width"))
    tallest = max((len(list(series_of(panel.rows))) for panel in panels), default=0)
    figure, axes = draw_panels(panels, _draw_panel, columns, panel_height(tallest))
    add_legend(figure, axes, list(TIME_BASELINES))
    write_foot(figure, rows, "right of a label: time of a frame, packets / method and its interval")
    return figure


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars, notes = [], []
    lines = {1, None, *column(rows, "packets_width").dropna()}
    for method, width, points in series_of(rows):
        name = say_series(method, width)
        notes += say_unmeasured(points, name)
        if method != PIXEL.name or width not in lines:
            best = best_rows(points)
            notes += say_wrong(best, name)
            bars.append(_make_bar(points, best, name, style_of(method, width)["color"], faint=width == 1))
    draw_bars(axis, bars)
    furthest = draw_ratio_baselines(axis, rows, OVER_PACKETS, upright=True)
    finish_bar_axes(axis, bars, f"speed-up over {say_baseline(OVER_PACKETS)}", furthest)
    write_notes(axis, notes)


def _make_bar(points: pd.DataFrame, best: pd.DataFrame, name: str, color: str, faint: bool) -> Bar:
    if len(best) == 0:
        status = [str(status) for status in points["status"].dropna().unique() if status != "ok"]
        return Bar(name, nan, nan, nan, color, " and ".join(status) or "not measured")
    row = best.iloc[0]
    label = ", ".join(filter(None, [name, say_split(row)]))
    text = f"{say_number(row['render_time_s'] * MILLISECONDS)} ms, {say_ratio(row)}"
    value, low, high = (float(numbers(best, f"{OVER_PACKETS}{end}")[0]) for end in ("", "_low", "_high"))
    return Bar(label, value, low, high, color, text, faint)
