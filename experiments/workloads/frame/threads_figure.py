"""How every method scales with threads: speed-up over its own time on one thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from matplotlib.transforms import offset_copy
from numpy.typing import NDArray

from experiments.drawing.axes import label_axes, place_counts, say_nothing_measured
from experiments.drawing.pages import add_legend, write_foot, write_lines, write_notes
from experiments.drawing.style import BLACK, DOTTED, TIMES
from experiments.drawing.values import column, drawable, interval, numbers
from experiments.methods.naming import best_of, say_series, say_split
from experiments.workloads.frame.break_even import time_rows
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.series import best_rows, say_unmeasured, series_of, style_of

_IDEAL = "ideal"
_SAME = ("split_x", "split_y", "culling", "geometry")


@dataclass(frozen=True)
class Scaling:
    """Speed-up of one series over itself on one thread; all arrays (N,), threads ascending from 1.

    low and high: the bounds that the intervals of both times allow. split: the one that was followed, in words.
    """

    threads: NDArray[np.int64]
    speedup: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    split: str


def draw_threads_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); both axes logarithmic.

    Every series follows the split that was best on one thread. A bar spans the ratios that the intervals of both times
    allow, since no round has both.
    """
    rows = time_rows(table)
    panels = make_panels(rows, (*best_of(), "packet_width", "threads"))
    drawn: dict[str, None] = {}
    figure, axes = draw_panels(panels, lambda axis, of_panel: drawn.update(_draw_panel(axis, of_panel)), columns, 4.6)
    add_legend(figure, axes, [*drawn, _IDEAL])
    write_foot(figure, rows, "bars here: the intervals of both times combined; below a panel: at the most threads")
    return figure


def scaling_of(rows: pd.DataFrame) -> Scaling | None:
    """Scaling of one method and packet width on one scene, or None without a time on one thread."""
    one = best_rows(rows[rows["threads"].eq(1).fillna(False).astype(bool)])
    if len(one) == 0:
        return None
    chosen = rows[rows["status"].eq("ok") & drawable(numbers(rows, "render_time_s"))]
    for name in _SAME:
        value, values = column(one, name).iloc[0], column(chosen, name)
        same = values.isna() if pd.isna(value) else values.eq(value).fillna(False)
        chosen = chosen[same.astype(bool)]
    chosen = chosen[chosen["threads"].notna()].sort_values("threads", kind="stable").drop_duplicates("threads")
    time_s, low_s, high_s = interval(chosen, "render_time{}_s")
    # One thread over itself is 1 whatever its spread.
    low, high = low_s[0] / high_s, high_s[0] / low_s
    low[0] = high[0] = 1.0
    return Scaling(chosen["threads"].to_numpy(np.int64), time_s[0] / time_s, low, high, say_split(one.iloc[0]))


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> dict[str, None]:
    """Draw one scene; returns the labels drawn, in their order."""
    drawn, notes = [], []
    for method, width, points in series_of(rows):
        name = say_series(method, width)
        for threads, of_threads in points.groupby("threads", dropna=False, sort=True):
            where = "every core" if pd.isna(threads) else f"threads {threads}"
            notes += say_unmeasured(of_threads, f"{name}, {where}")
        scaling = scaling_of(points)
        if scaling is None:
            if points["status"].eq("ok").any():
                notes.append(f"{TIMES} {name}: nothing to compare with on one thread")
            continue
        drawn.append((name, style_of(method, width), scaling))
    for place, (name, style, scaling) in enumerate(drawn):
        line = {"color": style["color"], "linestyle": style.get("linestyle", "-")}
        axis.plot(scaling.threads, scaling.speedup, linewidth=1.2, zorder=2, label="_line", **line)
        # Series lie close together, so marks are shifted a little; lines are not, which would change their slope.
        shift_points = 4.0 * (place - (len(drawn) - 1) / 2)
        beside = offset_copy(axis.transData, axis.get_figure(root=True), x=shift_points, units="points")
        axis.vlines(scaling.threads, scaling.low, scaling.high, color=style["color"], linewidth=1.1, transform=beside)
        axis.plot(
            scaling.threads, scaling.speedup, markersize=5, label=name, transform=beside, zorder=3,
            **style | {"linestyle": "none"},
        )  # fmt: skip
    _finish(axis, [scaling for _, _, scaling in drawn])
    lines = [
        (style["color"], [", ".join(filter(None, [name, scaling.split])) + f": {_say_last(scaling)}"])
        for name, style, scaling in drawn
    ]
    write_notes(axis, notes, write_lines(axis, lines))
    return dict.fromkeys(name for name, _, _ in drawn)


def _finish(axis: Axes, series: list[Scaling]) -> None:
    counts = place_counts(axis, (count for scaling in series for count in scaling.threads), 1.15)
    values = [value for scaling in series for value in (*scaling.speedup, *scaling.low, *scaling.high)]
    values = [value for value in values if np.isfinite(value) and value > 0]
    axis.set_yscale("log", base=2)
    top = max([1.1, counts[-1], *values])
    axis.plot([1, counts[-1]], [1, counts[-1]], color=BLACK, linestyle=DOTTED, linewidth=1.2, label=_IDEAL, zorder=4)
    axis.set_ylim(min([1.0, *values]) / 1.06, top * 1.06)
    step = 0.2 if top < 3 else 0.5 if top < 6 else 2
    ticks = [1.0, *(tick for tick in np.arange(0, top * 1.06, step) if tick > 1)] if top < 12 else counts
    axis.set_yticks(ticks)
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    axis.minorticks_off()
    label_axes(axis, "threads", "speed-up over one thread")
    if not series:
        say_nothing_measured(axis)


def _say_last(scaling: Scaling) -> str:
    """The value at a line's end in words."""
    bounds = f" [{scaling.low[-1]:.2f}, {scaling.high[-1]:.2f}]" if np.isfinite(scaling.low[-1]) else ""
    return f"{scaling.speedup[-1]:.2f}{TIMES}{bounds}"
