"""How every method scales with threads: speed-up over its own time on one thread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Figure, Line, Panel
from experiments.drawing.style import BLACK, DOTTED, TIMES
from experiments.drawing.values import column, drawable, interval, numbers
from experiments.methods.naming import best_of, say_series, say_split
from experiments.workloads.frame.break_even import time_rows
from experiments.workloads.panels import figure_of, make_panels, read_panels
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


def threads_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); both axes logarithmic.

    Every series follows the split that was best on one thread. A bar spans the ratios that the intervals of both times
    allow, since no round has both.
    """
    rows = time_rows(table)
    panels = read_panels(make_panels(rows, (*best_of(), "packet_width", "threads")), _panel)
    names = dict.fromkeys(line.label for panel in panels for line in panel.lines if line.label != _IDEAL)
    return figure_of(
        "lines", panels, rows, "bars here: the intervals of both times combined", x=Axis("threads", "ticks"),
        y=Axis("speed-up over one thread", say="{:.3g}".format), legend=[*names, _IDEAL],
        headings=("", "at the most threads"),
    )  # fmt: skip


def scaling_of(rows: pd.DataFrame) -> Scaling | None:
    """Scaling of one method and packet width on one scene, or None without a time on one thread."""
    single = best_rows(rows[rows["threads"].eq(1).fillna(False).astype(bool)])
    if len(single) == 0:
        return None
    chosen = rows[rows["status"].eq("ok") & drawable(numbers(rows, "render_time_s"))]
    for name in _SAME:
        value, values = column(single, name).iloc[0], column(chosen, name)
        same = values.isna() if pd.isna(value) else values.eq(value).fillna(False)
        chosen = chosen[same.astype(bool)]
    chosen = chosen[chosen["threads"].notna()].sort_values("threads", kind="stable").drop_duplicates("threads")
    time_s, low_s, high_s = interval(chosen, "render_time{}_s")
    # One thread over itself is 1 whatever its spread.
    low, high = low_s[0] / high_s, high_s[0] / low_s
    low[0] = high[0] = 1.0
    return Scaling(chosen["threads"].to_numpy(np.int64), time_s[0] / time_s, low, high, say_split(single.iloc[0]))


def _panel(rows: pd.DataFrame) -> Panel:
    lines, notes, table = [], [], []
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
        counts = scaling.threads.astype(np.float64)
        lines.append(Line(name, counts, scaling.speedup, style_of(method, width), (scaling.low, scaling.high)))
        table.append((", ".join(filter(None, [name, scaling.split])), _say_last(scaling)))
    if lines:
        ends = np.array([1.0, max(line.x.max() for line in lines)])
        lines.append(Line(_IDEAL, ends, ends, {"color": BLACK, "linestyle": DOTTED}, thin=True))
    return Panel(lines=lines, notes=notes, table=table)


def _say_last(scaling: Scaling) -> str:
    """The value at a line's end in words."""
    bounds = f" [{scaling.low[-1]:.2f}, {scaling.high[-1]:.2f}]" if np.isfinite(scaling.low[-1]) else ""
    return f"{scaling.speedup[-1]:.2f}{TIMES}{bounds}"
