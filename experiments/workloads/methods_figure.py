"""Every method at its best split: speed-up over packets."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes
from experiments.drawing.pages import write_notes
from experiments.drawing.values import MILLISECONDS, column, numbers, say_number
from experiments.methods import METHODS
from experiments.methods.naming import best_of
from experiments.methods.pixel import PIXEL
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import bars_height, make_panels, panels_figure
from experiments.workloads.series import (
    OVER_PACKETS,
    BestPoint,
    best_points,
    count_series,
    draw_ratio_baselines,
    say_baseline,
    say_ratio,
    say_unmeasured,
)


def draw_methods_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method and packet width at its best split, its whisker the interval. Single rays and the fastest packets
    per pixel, measured again with every point, are the two lines. Peers are left out.
    """
    rows = table[table["method"].isin([method.name for method in METHODS if method.is_ours])]
    panels = make_panels(rows, (*best_of(), "packet_width"))
    return panels_figure(
        panels, _draw_panel, columns, rows, "right of a label: time of a frame, packets / method and its interval",
        legend=list(TIME_BASELINES), height=bars_height(panels, count_series),
    )  # fmt: skip


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    bars, notes = [], []
    lines = {1, None, *column(rows, "packets_width").dropna()}
    for one in best_points(rows):
        if one.method == PIXEL.name and one.packet_width in lines:
            notes += say_unmeasured(one.points, one.name)
        else:
            notes += one.notes()
            bars.append(ratio_bar(one, faint=one.packet_width == 1) if len(one.best) else _without_value(one))
    draw_ratio_bars(axis, rows, bars, notes)


def _without_value(one: BestPoint) -> Bar:
    status = [str(status) for status in one.points["status"].dropna().unique() if status != "ok"]
    return Bar(one.name, nan, nan, nan, one.color, " and ".join(status) or "not measured")


def ratio_bar(one: BestPoint, faint: bool = False) -> Bar:
    """The ratio over packets of a series that has a best point."""
    row = one.best.iloc[0]
    text = f"{say_number(row['render_time_s'] * MILLISECONDS)} ms, {say_ratio(row)}"
    value, low, high = (float(numbers(one.best, f"{OVER_PACKETS}{end}")[0]) for end in ("", "_low", "_high"))
    return Bar(one.label, value, low, high, one.color, text, faint)


def draw_ratio_bars(axis: Axes, rows: pd.DataFrame, bars: Sequence[Bar], notes: Sequence[str]) -> None:
    """A panel of ratios over packets, with lines where both baselines of its rows lie, and notes below."""
    draw_bars(axis, bars)
    furthest = draw_ratio_baselines(axis, rows, OVER_PACKETS, upright=True)
    finish_bar_axes(axis, bars, f"speed-up over {say_baseline(OVER_PACKETS)}", furthest)
    write_notes(axis, notes)
