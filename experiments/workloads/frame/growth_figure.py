"""Time of a frame, and of what comes before it, over the triangles or the pixels."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from experiments.drawing.axes import draw_series, say_nothing_measured, tidy_axis
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes, write_table
from experiments.drawing.style import BLACK, DOTTED, GREY, SMALL
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, drawable, say_number
from experiments.methods import METHODS
from experiments.methods.naming import say_series
from experiments.workloads.frame.growth import (
    Growth,
    Panel,
    crossings,
    fitted_slope,
    growth_panels,
    growths,
    say_count,
    say_crossings,
)
from experiments.workloads.series import say_unmeasured, say_wrong, series_of, style_of

_HEADINGS = ("frame", "grows", "prepared", "grows", "MiB", "grows")
_PREPARATION = "its plan and build"

_ROOM = 20.0
"""How far the axis reaches below the shortest time, for numbers of crossings."""


def draw_growth_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene and a thing that grows; both axes logarithmic.

    A line is a method at its best split, dotted its plan and build. A ring marks where one overtakes another. Below
    each panel stand time, preparation and bytes at the largest size, and the fitted exponents of their growth.
    """
    panels = growth_panels(table)
    figure, axes = make_figure(len(panels), columns, 5.6)
    for axis, panel in zip(axes, panels, strict=True):
        set_panel_title(axis, panel.title, panel.stands_for)
        _draw_panel(axis, panel)
    widths = [None, 1, 4, 8, 16]
    names = dict.fromkeys(say_series(method.name, width) for method in METHODS for width in widths)
    add_legend(figure, axes, [*names, _PREPARATION])
    write_foot(
        figure, table, "dotted: plan and build; ring: one method overtakes another, by ratios within rounds",
        "below a panel, at the largest size: ms of a frame, ms of plan and build, MiB that the method holds by its own "
        "account; each followed by k of its growth as size to the power of k, fitted over all sizes",
    )  # fmt: skip
    return figure


def _draw_panel(axis: Axes, panel: Panel) -> None:
    axis.set_xscale("log")
    axis.set_yscale("log")
    drawn = list(growths(panel))
    entries = []
    for one in drawn:
        style = style_of(one.method, None if one.packet_width == 1 else one.packet_width)
        interval = (one.low_s * MILLISECONDS, one.high_s * MILLISECONDS)
        draw_series(axis, one.sizes, one.time_s * MILLISECONDS, style, interval, one.name)
        prepared = drawable(one.preparation_s)
        axis.plot(
            one.sizes[prepared], one.preparation_s[prepared] * MILLISECONDS, linewidth=1.2, linestyle=DOTTED, zorder=2,
            color=style["color"], label="_preparation",
        )  # fmt: skip
        entries.append((style["color"], one.name, _cells(one)))
    _draw_crossings(axis, drawn)
    axis.plot([], [], linewidth=1.2, linestyle=DOTTED, color=GREY, label=_PREPARATION)
    _finish(axis, panel, drawn)
    notes = list(say_crossings(panel))
    for method, width, points in series_of(panel.rows):
        name = say_series(method, width)
        notes += [*say_unmeasured(points, name), *say_wrong(points, name)]
    write_notes(axis, notes, write_table(axis, _HEADINGS, entries))


def _cells(one: Growth) -> list[str]:
    cells = []
    for values, unit in ((one.time_s, MILLISECONDS), (one.preparation_s, MILLISECONDS), (one.bytes, MEBIBYTES)):
        slope = fitted_slope(one.sizes, values)
        known = values[np.isfinite(values)]
        cells += [say_number(known[-1] * unit) if len(known) else "-", "-" if slope is None else f"k = {slope:.2f}"]
    return cells


def _draw_crossings(axis: Axes, drawn: list[Growth]) -> None:
    found = [(one, other, at.size) for one, other in combinations(drawn, 2) for at in crossings(one, other)]
    for place, (one, other, size) in enumerate(sorted(found, key=lambda crossing: crossing[2])):
        # Where the two lines pass, or nearly: they were measured hours apart.
        times = [np.interp(np.log(size), np.log(of.sizes), np.log(of.time_s)) for of in (one, other)]
        time_ms = float(np.exp(np.mean(times))) * MILLISECONDS
        axis.plot([size, size], [1e-9, time_ms], color=BLACK, linewidth=1, linestyle=DOTTED, zorder=2, label="_line")
        axis.plot(
            [size], [time_ms], "o", color=BLACK, markerfacecolor="none", markersize=9, markeredgewidth=1.5, zorder=5,
            label="_ring",
        )  # fmt: skip
        # Crossings lie close together: each number has its own height.
        axis.annotate(
            say_count(size), (size, 0.03 + 0.075 * place), xycoords=("data", "axes fraction"), xytext=(3, 0),
            textcoords="offset points", fontsize=SMALL, fontweight="bold", zorder=6,
        )  # fmt: skip


def _finish(axis: Axes, panel: Panel, drawn: list[Growth]) -> None:
    sizes = np.unique(np.concatenate([one.sizes for one in drawn])) if drawn else np.array([1.0])
    axis.set_xticks(sizes, [say_count(size) for size in sizes])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.set_xlim(sizes[0] / 1.3, sizes[-1] * 1.3)
    least = [one.time_s[drawable(one.time_s)].min() for one in drawn if drawable(one.time_s).any()]
    if least:
        # Where nearly nothing is prepared, the table below says so.
        axis.set_ylim(bottom=min(least) * MILLISECONDS / _ROOM)
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_xlabel(panel.unit)
    axis.set_ylabel("ms")
    tidy_axis(axis)
    if not drawn:
        axis.set_yticks([])
        say_nothing_measured(axis)
