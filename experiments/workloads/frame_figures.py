"""Figures of frame times and of gathering: times and speed-ups over splits, and every method at its best split."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import nan

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Bar, Figure, Level, Line, Mark, Panel
from experiments.drawing.missing import absent_points, without_value
from experiments.drawing.style import BLACK, DASH_DOTTED, GREY, TIMES
from experiments.drawing.values import (
    MILLISECONDS,
    column,
    drawable,
    interval,
    numbers,
    only_measured,
    row_interval,
    say_number,
    varies,
)
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
from experiments.results.time_warnings import WRONG
from experiments.workloads import series
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.panels import figure_of, make_panels, read_panels
from experiments.workloads.reported import BEST_SPEEDUPS, PAPER_SIZE

ALL_HITS = f"1 {TIMES} 1, culling off: all hits"
"""The paper's other possible baseline: the method with nothing to align."""

PAPER_BEST = "the paper's best"

RATIO_LABELS = (*FORM_STYLES, *TIME_BASELINES, ALL_HITS, PAPER_BEST)
"""In the order of the legends."""

SPLIT_AXES = {"split_x": Axis("horizontal splits", "ticks"), "split_y": Axis("vertical splits", "ticks")}

_RING = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "markeredgewidth": 1.6}
_RINGED = "ringed: the best split, by the ratio in the same rounds"
_STAR = f"star: {PAPER_BEST} speed-up of single rays, at whatever number of splits"


def rows_over(*axes: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """Aligned rows and those of methods of files, if exactly these of the axes of aligned splits vary."""

    def chosen(rows: pd.DataFrame) -> pd.DataFrame:
        aligned = aligned_rows(rows)
        told = pd.concat([aligned, series.of_files(rows)])
        return told if {axis for axis in SPLIT_AXES if varies(aligned, axis)} == set(axes) else rows[:0]

    return chosen


def split_times(table: pd.DataFrame, axis_name: str = "split_x") -> Figure:
    """One panel a scene (and a value of any other setting that varies); milliseconds a frame over splits, both
    logarithmic.

    axis_name: `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical). The baselines, measured
    beside every point, are lines at their medians.
    """
    return _over_splits(table, axis_name, False, "time of a frame in ms")


def split_ratios(table: pd.DataFrame, axis_name: str = "split_x", with_paper: bool = False) -> Figure:
    """The same in speed-ups: ratios within rounds of single rays over rtcIntersect1 and of packets over packets, with
    intervals. Horizontal lines are other baselines. with_paper: the paper's best stand among single rays."""
    return _over_splits(table, axis_name, True, "speed-up", with_paper)


def _over_splits(
    table: pd.DataFrame, axis_name: str, in_ratios: bool, quantity: str, with_paper: bool = False
) -> Figure:
    panels = make_panels(aligned_rows(table), (axis_name, *FORM_OPTIONS))
    panels = [replace(panel, rows=pd.concat([panel.rows, series.beside(panel.rows, table)])) for panel in panels]
    shown = read_panels(panels, lambda rows: splits_panel(rows, axis_name, in_ratios, with_paper))
    notes = [_RINGED, *([_STAR] if any(mark.label == PAPER_BEST for panel in shown for mark in panel.marks) else [])]
    legend = [*RATIO_LABELS, *(point.name for point in series.best_points(series.of_files(table)))]
    return figure_of(
        "lines", shown, table, "both axes are logarithmic", *notes, legend=legend, x=SPLIT_AXES[axis_name],
        y=Axis(quantity),
    )  # fmt: skip


def splits_panel(table: pd.DataFrame, axis_name: str, in_ratios: bool, with_paper: bool = False) -> Panel:
    """A line for each form of the geometry, a ring around its best split, a level for each baseline and for each method
    of a file, which has no splits, at the best of its options; and in words what is best and what is missing.

    in_ratios: speed-ups in place of milliseconds, over all hits, too, where the row that splits and culls nothing was
    measured.
    """
    rows = aligned_rows(table)
    ratio = series.own_ratio(rows) if in_ratios else None
    starts = [float(height) for height in all_hits(rows)] if in_ratios else []
    drawn = ("render_time{}_s", MILLISECONDS) if ratio is None else (ratio + "{}", 1.0)
    levels = series.baseline_levels(rows, ratio)
    levels += [Level(ALL_HITS, height, {"color": GREY, "linestyle": DASH_DOTTED}) for height in starts]
    lines, marks, missing, notes, forms = [], [], [], [], aligned_forms(rows)
    for form, points in forms.items():
        style, short = FORM_STYLES[form], form.removeprefix("aligned, ")
        value, low, high = (only_measured(points, values) for values in interval(points, *drawn))
        lines.append(Line(form, numbers(points, axis_name), value, style, (low, high)))
        missing += without_value(points, value, axis_name, short, style["color"])
        missing += absent_points(points, set(rows[axis_name].dropna()), axis_name, short, style["color"])
        # A single one is no choice.
        for _, best in series.best_rows(points if drawable(value).sum() > 1 else points[:0]).iterrows():
            heights = value[(points[axis_name] == best[axis_name]).to_numpy(bool)]
            marks += [
                Mark("", float(best[axis_name]), float(height), {"color": style["color"]} | _RING) for height in heights
            ]
            notes.append(f"{short}: {_say_best(best, axis_name, ratio, starts)}")
    absent = [form for form in expected_forms(rows) if form not in forms]
    notes += [f"{form.removeprefix('aligned, ')}: not in the table" for form in absent]
    baselines = [label for label, (name, _) in TIME_BASELINES.items() if not drawable(numbers(rows, name)).any()]
    unmeasured = [*([ALL_HITS] if in_ratios and not starts else []), *baselines]
    notes += [f"{label}: not measured" for label in unmeasured]
    for point in series.best_points(series.of_files(table)):
        for _, best in point.best.iterrows():
            height, *ends = row_interval(best, *drawn)
            if height > 0:
                levels.append(Level(point.name, height, {"color": point.color}, *ends))
            notes.append(f"{point.name}: {say_level(best, ratio)}")
        notes += series.say_wrong(point.best, point.name)
    if with_paper and ratio == series.OVER_SINGLE:
        marks += _paper_best(rows, axis_name)
    y = None if ratio is None else Axis(f"speed-up over {series.say_baseline(ratio)}")
    return Panel(lines=lines, marks=marks, levels=levels, crosses=missing, notes=notes, y=y)


def _say_best(best: pd.Series, axis_name: str, ratio: str | None, starts: list[float]) -> str:
    """ "128 best, 20.0 ms, 1.50×; over all hits 7.50×"."""
    time_s = best.get("render_time_s")
    words = [f"{best[axis_name]} best", *([] if pd.isna(time_s) else [f"{say_number(time_s * MILLISECONDS)} ms"])]
    if ratio is None:
        return ", ".join(words)
    over = "".join(f"; over all hits {best[ratio] / height:.2f}{TIMES}" for height in starts)
    return ", ".join([*words, f"{best[ratio]:.2f}{TIMES}{over}"])


def _paper_best(rows: pd.DataFrame, axis_name: str) -> list[Mark]:
    """The paper's best speed-up, where ours are of its scene and size: at the most splits, as it does not say at how
    many."""
    measured = rows[rows["status"] == "ok"]
    known = [BEST_SPEEDUPS[scene] for scene in measured["scene"].unique() if scene in BEST_SPEEDUPS]
    if not (measured["width"].eq(PAPER_SIZE[0]) & measured["height"].eq(PAPER_SIZE[1])).all():
        return []
    looks = {"color": BLACK, "marker": "*", "markersize": 9}
    return [Mark(PAPER_BEST, float(measured[axis_name].max()), value, looks) for value in known]


def all_hits(rows: pd.DataFrame) -> NDArray[np.float64]:
    """The ratio of a panel's aligned row that splits and culls nothing; empty where it was not measured."""
    gathering = rows[rows["split_x"].eq(1) & rows["split_y"].eq(1) & ~rows["culling"].fillna(True)]
    points = aligned_forms(gathering).get(COPIED_OFF, rows[:0])
    ratios = only_measured(points, numbers(points, series.own_ratio(rows)))
    return ratios[drawable(ratios)]


def say_level(row: pd.Series, ratio: str | None = None) -> str:
    """ "20.0 ms, 0.75×" of a row without splits; before it its options, where they are not the usual ones."""
    words = [say_variant(row), f"{say_number(row['render_time_s'] * MILLISECONDS)} ms"]
    words += [] if ratio is None or pd.isna(row[ratio]) else [f"{row[ratio]:.2f}{TIMES}"]
    return ", ".join(filter(None, words))


def methods_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); ratios within rounds, from zero.

    A bar is a method and packet width at its best split, its whisker the interval. Single rays and the fastest packets
    per pixel, measured again with every point, are the two lines.
    """
    panels = read_panels(make_panels(table, (*best_of(), "packet_width")), _methods)
    return figure_of(
        "bars", panels, table, x=Axis(f"speed-up over {series.say_baseline(series.OVER_PACKETS)}", "linear"),
        legend=list(TIME_BASELINES), headings=("", "time of a frame, packets / method and its interval"),
    )  # fmt: skip


def _methods(rows: pd.DataFrame) -> Panel:
    lines = {1, None, *column(rows, "packets_width").dropna()}
    points = [
        point
        for point in series.best_points(rows)
        if not (point.method == PIXEL.name and point.packet_width in lines)  # these are levels
    ]
    return Panel(
        bars=[_ratio_bar(point) if len(point.best) else _without_value(point) for point in points],
        levels=series.baseline_levels(rows, series.OVER_PACKETS),
        notes=[line for point in points for line in series.say_wrong(point.best, point.name)],
    )


def _without_value(point: series.BestPoint) -> Bar:
    known = [str(status) for status in point.points["status"].dropna().unique() if status != "ok"]
    status = [f"{TIMES} {WRONG} image" if status == WRONG else status for status in known]
    return Bar(point.name, nan, nan, nan, point.color, " and ".join(status) or "not measured")


def _ratio_bar(point: series.BestPoint) -> Bar:
    """The ratio over packets of a series that has a best point."""
    row = point.best.iloc[0]
    text = f"{say_number(row['render_time_s'] * MILLISECONDS)} ms, {series.say_ratio(row)}"
    value, low, high = row_interval(row, series.OVER_PACKETS + "{}")
    return Bar(point.label, value, low, high, point.color, text, point.is_single)
