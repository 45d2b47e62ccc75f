"""Figures of frame times and of gathering: times and speed-ups over splits, and every method at its best split."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.drawing.axes import draw_baseline, draw_level, draw_series, finish_split_axes
from experiments.drawing.bars import Bar
from experiments.drawing.missing import Missing, absent_points, mark_missing, without_value
from experiments.drawing.pages import write_lines
from experiments.drawing.style import DASH_DOTTED, GREY, TIMES
from experiments.drawing.values import (
    MILLISECONDS,
    column,
    drawable,
    interval,
    numbers,
    only_measured,
    row_interval,
    say_number,
)
from experiments.methods import METHODS
from experiments.methods.naming import (
    COPIED_OFF,
    FORM_OPTIONS,
    FORM_STYLES,
    aligned_forms,
    aligned_rows,
    best_of,
    expected_forms,
    say_variant,
)
from experiments.methods.pixel import PIXEL
from experiments.results.doubts import WRONG
from experiments.workloads import series
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import Bars, Panel, bars_figure, make_panels, panels_figure

ALL_HITS = f"1 {TIMES} 1, culling off: all hits"
"""The paper's other possible baseline: the method with nothing to align."""

RATIO_LABELS = (*FORM_STYLES, *TIME_BASELINES, ALL_HITS)
"""In the order of the legends."""

_RINGED = "ringed, and in words below: the best split, by the ratio in the same rounds"

_RING: dict[str, Any] = {
    "markersize": 13, "markerfacecolor": "none", "markeredgewidth": 1.8, "zorder": 4, "label": "_best",
}  # fmt: skip
"""Marks the best split; its numbers stand below the panel, where they hide no line."""


def draw_split_times(table: pd.DataFrame, columns: int = 2, axis_name: str = "split_x") -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds a frame over splits, both
    logarithmic.

    axis_name: `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical). The baselines, measured
    beside every point, are lines at their medians.
    """
    return _draw(table, columns, axis_name, draw_times, "both axes are logarithmic")


def draw_split_ratios(table: pd.DataFrame, columns: int = 2, axis_name: str = "split_x") -> Figure:
    """The same in speed-ups: ratios within rounds of single rays over rtcIntersect1 and of packets over packets, with
    intervals. Horizontal lines are other baselines."""
    return _draw(table, columns, axis_name, draw_ratios)


def _draw(table: pd.DataFrame, columns: int, axis_name: str, draw_panel: Callable[..., None], *foot: str) -> Figure:
    panels = make_panels(aligned_rows(table), (axis_name, *FORM_OPTIONS))
    panels = [replace(one, rows=pd.concat([one.rows, series.beside(one.rows, table)])) for one in panels]
    draw = partial(draw_panel, axis_name=axis_name)
    legend = [*RATIO_LABELS, *(one.name for one in series.best_points(series.of_files(table)))]
    return panels_figure(panels, draw, columns, table, *foot, _RINGED, legend=legend)


def draw_times(axis: Axes, rows: pd.DataFrame, axis_name: str) -> None:
    """Milliseconds a frame of one panel's aligned rows, each form of the geometry a line, with the baselines, and of
    methods of files, which have no splits, as levels."""
    others, rows = series.of_files(rows), aligned_rows(rows)
    for label, (name, style) in TIME_BASELINES.items():
        draw_baseline(axis, numbers(rows, name) * MILLISECONDS, style, label)
    say_best = partial(_say_best_time, axis_name=axis_name)
    levels = _draw_levels(axis, others, ("render_time{}_s", MILLISECONDS), say_level)
    notes = _unmeasured_baselines(rows)
    _draw_forms(axis, rows, axis_name, ("render_time{}_s", MILLISECONDS), say_best, notes, levels)
    finish_split_axes(axis, rows[axis_name], axis_name, "time of a frame in ms")


def draw_ratios(axis: Axes, rows: pd.DataFrame, axis_name: str) -> None:
    """Ratios of one panel's aligned rows, each form of the geometry a line, with the baselines, and of methods of
    files, which have no splits, as levels."""
    others, rows = series.of_files(rows), aligned_rows(rows)
    ratio, start = series.own_ratio(rows), all_hits(rows)
    series.draw_ratio_baselines(axis, rows, ratio)
    for height in start:
        axis.axhline(height, color=GREY, linestyle=DASH_DOTTED, linewidth=1.5, zorder=2, label=ALL_HITS)

    def say_best(best: pd.Series) -> str:
        over = "".join(f"; over all hits {best[ratio] / height:.2f}{TIMES}" for height in start)
        return f"{_say_best_time(best, axis_name)}, {best[ratio]:.2f}{TIMES}{over}"

    notes = [*([] if len(start) else [f"{ALL_HITS}: not measured"]), *_unmeasured_baselines(rows)]
    levels = _draw_levels(axis, others, (ratio + "{}", 1.0), partial(say_level, ratio=ratio))
    _draw_forms(axis, rows, axis_name, (ratio + "{}", 1.0), say_best, notes, levels)
    finish_split_axes(axis, rows[axis_name], axis_name, f"speed-up over {series.say_baseline(ratio)}")


def _say_best_time(best: pd.Series, axis_name: str) -> str:
    """ "128 best, 20.0 ms"."""
    time_s = best.get("render_time_s")
    return f"{best[axis_name]} best" + ("" if pd.isna(time_s) else f", {say_number(time_s * MILLISECONDS)} ms")


def all_hits(rows: pd.DataFrame) -> NDArray[np.float64]:
    """The ratio of a panel's aligned row that splits and culls nothing; empty where it was not measured."""
    gathering = rows[rows["split_x"].eq(1) & rows["split_y"].eq(1) & ~rows["culling"].fillna(True)]
    points = aligned_forms(gathering).get(COPIED_OFF, rows[:0])
    ratios = only_measured(points, numbers(points, series.own_ratio(rows)))
    return ratios[drawable(ratios)]


def _unmeasured_baselines(rows: pd.DataFrame) -> list[str]:
    """In words."""
    columns = {label: name for label, (name, _) in TIME_BASELINES.items()}
    return [f"{label}: not measured" for label, name in columns.items() if not drawable(numbers(rows, name)).any()]


_Levels = tuple[list[tuple[str, list[str]]], list[str]]
"""Lines of `write_lines` and notes of `write_notes` on the levels of a panel."""


def _draw_levels(
    axis: Axes, rows: pd.DataFrame, drawn: tuple[str, float], say: Callable[[pd.Series], str]
) -> _Levels:  # fmt: skip
    """A level for each method of a file, at the best of its options. drawn: as of `_draw_forms`. say: its best row in
    words."""
    lines, notes = [], []
    for one in series.best_points(rows):
        notes += one.notes()
        for _, best in one.best.iterrows():
            ends = row_interval(best, *drawn)
            if ends[0] > 0:
                draw_level(axis, ends, one.color, one.name)
            lines.append((one.color, [f"{one.name}: {say(best)}"]))
    return lines, notes


def say_level(row: pd.Series, ratio: str | None = None) -> str:
    """ "20.0 ms, 0.75×" of a row without splits; before it its options, where they are not the usual ones."""
    words = [say_variant(row), f"{say_number(row['render_time_s'] * MILLISECONDS)} ms"]
    words += [] if ratio is None or pd.isna(row[ratio]) else [f"{row[ratio]:.2f}{TIMES}"]
    return ", ".join(filter(None, words))


def _draw_forms(
    axis: Axes, rows: pd.DataFrame, axis_name: str, drawn: tuple[str, float], say_best: Callable[[pd.Series], str],
    notes: Sequence[str], levels: _Levels,
) -> None:  # fmt: skip
    """A line for each form, a ring around its best split, and below the panel what is best and what is missing.

    drawn: the columns and the factor of `interval`. levels: lines and notes that follow.
    """
    missing: list[Missing] = []
    lines: list[tuple[str, list[str]]] = []
    forms = aligned_forms(rows)
    for form, points in forms.items():
        style, short = FORM_STYLES[form], form.removeprefix("aligned, ")
        value, *ends = (only_measured(points, values) for values in interval(points, *drawn))
        draw_series(axis, numbers(points, axis_name), value, style, ends, form)
        missing += without_value(points, value, axis_name, short, style["color"])
        missing += absent_points(points, set(rows[axis_name].dropna()), axis_name, short, style["color"])
        # A single one is no choice.
        for _, best in series.best_rows(points if drawable(value).sum() > 1 else points[:0]).iterrows():
            height = value[(points[axis_name] == best[axis_name]).to_numpy(bool)]
            axis.plot([best[axis_name]] * len(height), height, "o", **_RING, markeredgecolor=style["color"])
            lines.append((style["color"], [f"{short}: {say_best(best)}"]))
    absent = [f"{one.removeprefix('aligned, ')}: not in the table" for one in expected_forms(rows) if one not in forms]
    beside, of_levels = levels
    mark_missing(axis, missing, write_lines(axis, [*lines, *beside]), [*absent, *notes, *of_levels])


def draw_methods_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method and packet width at its best split, its whisker the interval. Single rays and the fastest packets
    per pixel, measured again with every point, are the two lines. Peers are left out; methods of a file are not.
    """
    rows = table[table["method"].isin([method.name for method in METHODS if not method.is_peer])]
    panels = make_panels(rows, (*best_of(), "packet_width"))
    foot = "right of a label: time of a frame, packets / method and its interval"
    return over_packets_figure(panels, _methods, columns, rows, foot, count=series.count_series)


def _methods(rows: pd.DataFrame) -> Bars:
    bars, notes = [], []
    lines = {1, None, *column(rows, "packets_width").dropna()}
    for one in series.best_points(rows):
        if one.method == PIXEL.name and one.packet_width in lines:
            notes += series.say_unmeasured(one.points, one.name)
        else:
            notes += one.notes()
            bars.append(ratio_bar(one, faint=one.packet_width == 1) if len(one.best) else _without_value(one))
    return bars, notes


def _without_value(one: series.BestPoint) -> Bar:
    known = [str(status) for status in one.points["status"].dropna().unique() if status != "ok"]
    status = [f"{TIMES} {WRONG} image" if status == WRONG else status for status in known]
    return Bar(one.name, nan, nan, nan, one.color, " and ".join(status) or "not measured")


def ratio_bar(one: series.BestPoint, faint: bool = False) -> Bar:
    """The ratio over packets of a series that has a best point."""
    row = one.best.iloc[0]
    text = f"{say_number(row['render_time_s'] * MILLISECONDS)} ms, {series.say_ratio(row)}"
    value, low, high = (float(end[0]) for end in interval(one.best, series.OVER_PACKETS + "{}"))
    return Bar(one.label, value, low, high, one.color, text, faint)


def over_packets_figure(
    panels: Sequence[Panel], read: Callable[[pd.DataFrame], Bars], columns: int, rows: pd.DataFrame, *foot: str,
    count: Callable[[pd.DataFrame], int],
) -> Figure:  # fmt: skip
    """`bars_figure` of ratios over packets, with lines where both baselines of a panel's rows lie."""
    return bars_figure(
        panels, read, f"speed-up over {series.say_baseline(series.OVER_PACKETS)}", columns, rows, *foot,
        draw_lines=partial(series.draw_ratio_baselines, ratio=series.OVER_PACKETS, upright=True),
        legend=list(TIME_BASELINES), count=count,
    )  # fmt: skip
