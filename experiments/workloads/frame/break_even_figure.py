"""What every method costs from the first frame to the thousandth, and from which frame on it is ahead of packets."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.drawing.axes import say_nothing_measured, tidy_axis
from experiments.drawing.pages import add_legend, write_foot, write_notes, write_table
from experiments.drawing.style import DOTTED, GREEN, SMALL, TIMES
from experiments.drawing.values import MILLISECONDS, say_number
from experiments.methods import METHODS
from experiments.methods.naming import best_of, say_series, say_split
from experiments.methods.pixel import PIXEL
from experiments.workloads.frame.break_even import (
    Cost,
    baseline_costs,
    break_even_frames,
    cost_of,
    cumulative_time_s,
    time_rows,
)
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.ratios import OVER_PACKETS, best_rows, choosing
from experiments.workloads.series import say_unmeasured, series_of, style_of

LAST_FRAME = 1000

_BASELINE = "fastest packets per pixel"
_HEADINGS = ("plan", "build", "first", "further", "bytes", "ahead from")


def draw_break_even_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); seconds over frames.

    Both axes are logarithmic. A line is a method at its best split and packet width: plan, build and first frame, then
    its usual frame again and again. A ring marks the frame from which on it is ahead of packets per pixel, whatever
    their build quality: their line is of the cheapest. Below each panel stand the parts of the cost.
    """
    rows = time_rows(table)
    rows = rows[rows["method"].isin([*_prepared(), PIXEL.name])]
    panels = make_panels(rows, (*best_of(), "packet_width"))
    figure, axes = draw_panels(panels, _draw_panel, columns, height=5.4)
    add_legend(figure, axes, [*(say_series(method, None) for method in _prepared()), _BASELINE])
    write_foot(
        figure, rows, f"ring: ahead of {_BASELINE} from this frame on, whatever their build",
        "below a panel: ms once for plan and build, of the first frame and of every further one; Embree's bytes over "
        "those of packets",
    )  # fmt: skip
    return figure


def _prepared() -> list[str]:
    """Methods of ours but the baseline."""
    return [method.name for method in METHODS if method.is_ours and method.name != PIXEL.name]


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    notes: list[str] = []
    baselines = baseline_costs(rows)
    entries: list[tuple[str, str, dict[str, Any], Cost]] = []
    for method in _prepared():
        points = rows[rows["method"].eq(method).fillna(False).astype(bool)]
        for _, width, of_width in series_of(points):
            notes += say_unmeasured(of_width, say_series(method, width))
        row = _best_of_all(points)
        cost = cost_of(row) if row is not None else None
        if row is None or cost is None:
            if points["status"].eq("ok").any():
                notes.append(f"{TIMES} {say_series(method, None)}: plan, build or first frame not measured")
            continue
        width = None if pd.isna(row["packet_width"]) else int(row["packet_width"])
        name = ", ".join(filter(None, [say_series(method, width), say_split(row)]))
        entries.append((say_series(method, None), name, style_of(method, None), cost))
    if not baselines:
        notes.append(f"{TIMES} {_BASELINE}: not measured in full, so no break-even")
    for quality, baseline in baselines.items():
        name = _BASELINE if baseline is next(iter(baselines.values())) else f"the same, {quality} build quality"
        entries.append((_BASELINE, name, {"color": GREEN}, baseline))
    _draw_lines(axis, entries, list(baselines.values()))
    write_notes(axis, notes, _write_parts(axis, entries, list(baselines.values())))


def _best_of_all(points: pd.DataFrame) -> pd.Series | None:
    """The best split at the best packet width."""
    best = best_rows(points)
    if len(best) == 0:
        return None
    return best.iloc[int(np.argmax(choosing(best, OVER_PACKETS)))]


def _draw_lines(axis: Axes, entries: list[tuple[str, str, dict[str, Any], Cost]], baselines: list[Cost]) -> None:
    frames = np.unique(np.geomspace(1, LAST_FRAME, 200).round().astype(np.int64))
    axis.set_xscale("log")
    axis.set_yscale("log")
    rings = []
    for label, _, style, cost in entries:
        if cost in baselines[1:]:
            continue
        times_s = [cumulative_time_s(one, frames) for one in (baselines if cost in baselines else [cost])]
        line = {"color": style["color"], "linestyle": DOTTED if cost in baselines else "-"}
        axis.plot(frames, np.min(times_s, axis=0), linewidth=1.6, label=label, zorder=3, **line)
        even = None if not baselines or cost in baselines else break_even_frames(cost, baselines)
        if even is not None and even <= LAST_FRAME:
            rings.append((even, float(cumulative_time_s(cost, np.array([even]))[0]), style["color"]))
    if entries:
        low, high = axis.get_ylim()
        axis.set_ylim(low / 4, high)
    for place, (even, time_s, color) in enumerate(sorted(rings)):
        axis.plot([even, even], [axis.get_ylim()[0], time_s], color=color, linewidth=1, linestyle=(0, (1, 2)), zorder=2)
        axis.plot(
            [even], [time_s], "o", color=color, markerfacecolor="white", markersize=8, markeredgewidth=1.8, zorder=5,
            label="_ring",
        )  # fmt: skip
        late = even**2 > LAST_FRAME
        # Break-evens lie close together: each number has its own height.
        axis.annotate(
            f"frame {even:,}", (even, 0.03 + 0.055 * place), xycoords=("data", "axes fraction"),
            xytext=(-3 if late else 3, 0), textcoords="offset points", ha="right" if late else "left", fontsize=SMALL,
            fontweight="bold", color=color, zorder=6,
        )  # fmt: skip
    axis.set_xlim(0.9, LAST_FRAME * 1.05)
    for one in (axis.xaxis, axis.yaxis):
        one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_xlabel("frames of one view")
    axis.set_ylabel("time in s, plan and build included")
    tidy_axis(axis)
    if not entries:
        axis.set_yticks([])
        say_nothing_measured(axis)


def _write_parts(axis: Axes, entries: list[tuple[str, str, dict[str, Any], Cost]], baselines: list[Cost]) -> int:
    """The parts of every cost below the panel: times in ms, bytes over those of the usual packets, the break-even."""
    lines = []
    for _, name, style, cost in entries:
        times = (cost.plan_time_s, cost.build_time_s, cost.first_frame_time_s, cost.frame_time_s)
        cells = [*(_ms(time_s) for time_s in times), _say_bytes(cost, baselines), _say_even(cost, baselines)]
        lines.append((style["color"], name, cells))
    return write_table(axis, _HEADINGS, lines)


def _say_bytes(cost: Cost, baselines: list[Cost]) -> str:
    stored = baselines[0].embree_bytes if baselines else None
    return f"{cost.embree_bytes / stored:.2f}{TIMES}" if cost.embree_bytes and stored else "-"


def _say_even(cost: Cost, baselines: list[Cost]) -> str:
    if not baselines or cost in baselines:
        return "-"
    even = break_even_frames(cost, baselines)
    return "never" if even is None else f"frame {even:,}"


def _ms(time_s: float) -> str:
    return say_number(time_s * MILLISECONDS)
