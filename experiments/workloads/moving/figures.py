"""Figure of a moving camera: every method at its best split, beside packets that build anew or keep their BVH."""

from __future__ import annotations

from math import nan

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes, panel_height
from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.pages import add_legend, write_foot, write_notes
from experiments.drawing.style import GREEN
from experiments.drawing.values import MILLISECONDS, numbers, say_number
from experiments.methods.naming import best_of, say_series, say_split
from experiments.results.table import workload_rows
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.moving import MOVING
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import OVER_PACKETS, best_rows, draw_ratio_baselines, say_baseline
from experiments.workloads.series import say_ratio, say_unmeasured, say_wrong, series_of, style_of

_KEPT = "packets, BVH of the world kept"


def draw_moving_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method at its best split, its whisker the interval; what it does for a new eye is part of its frame. So
    it is of single rays and the fastest packets per pixel, the two lines. The last bar is packets that need not.
    """
    panels = make_panels(table, (*best_of(), "packet_width"))
    tallest = max((len(list(series_of(panel.rows))) + 1 for panel in panels), default=0)
    figure, axes = draw_panels(panels, _draw_panel, columns, panel_height(tallest))
    add_legend(figure, axes, list(TIME_BASELINES))
    write_foot(
        figure, table, "right of a label: time of a frame from another eye, packets / method and its interval",
        "packets that keep a BVH of the world are not as exact",
    )  # fmt: skip
    return figure


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars, notes = [], []
    for method, width, points in series_of(rows):
        name, best = say_series(method, width), best_rows(points)
        notes += [*say_unmeasured(points, name), *say_wrong(best, name)]
        if len(best):
            label = ", ".join(filter(None, [name, say_split(best.iloc[0])]))
            bars.append(_method_bar(best, label, style_of(method, width)["color"]))
    bars += _kept_bars(best_rows(rows))
    draw_bars(axis, bars)
    furthest = draw_ratio_baselines(axis, rows, OVER_PACKETS, upright=True)
    finish_bar_axes(axis, bars, f"speed-up over {say_baseline(OVER_PACKETS)}", furthest)
    write_notes(axis, notes)


def _method_bar(best: pd.DataFrame, label: str, color: str) -> Bar:
    text = f"{say_number(best.iloc[0]['render_time_s'] * MILLISECONDS)} ms, {say_ratio(best.iloc[0])}"
    value, low, high = (float(numbers(best, f"{OVER_PACKETS}{end}")[0]) for end in ("", "_low", "_high"))
    return Bar(label, value, low, high, color, text)


def _kept_bars(rows: pd.DataFrame) -> list[Bar]:
    """One, without an interval, of the medians over all points, which all measured it; none where none did."""
    kept_s, packets_s = (_median(rows, name) for name in ("kept_packets_time_s", "packets_render_time_s"))
    text = f"{say_number(kept_s * MILLISECONDS)} ms"
    return [Bar(_KEPT, packets_s / kept_s, nan, nan, GREEN, text, faint=True)] if kept_s > 0 else []


def _median(rows: pd.DataFrame, name: str) -> float:
    values = numbers(rows, name)
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else nan


FIGURES = (
    FigureKind(
        "moving", "Speed-up over packets of every method while the camera moves",
        lambda table: workload_rows(table, MOVING.name), of_table(draw_moving_figure),
    ),
)  # fmt: skip
