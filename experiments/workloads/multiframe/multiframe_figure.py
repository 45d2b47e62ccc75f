"""Several frames in one pass: time per frame and memory over the number of frames, beside frame by frame."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_series, place_counts, say_nothing_measured, tidy_axis
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes, write_table
from experiments.drawing.style import BLACK, DASHED, GREY, PURPLE
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, column, drawable, numbers
from experiments.methods.naming import best_of, say_split
from experiments.workloads.multiframe.frame_parts import (
    PACKETS,
    SEPARATE_FRAMES,
    TOGETHER,
    VISIBLE_FRAMES,
    WAYS,
    Way,
    best_row,
    say_speedup,
)
from experiments.workloads.panels import Panel, make_panels
from experiments.workloads.series import say_unmeasured

MOTIONS = {"eyes": "two eyes", "walk": "the camera walks", "turn": "the mesh turns"}
"""In words, in the order of the panels."""

_PEAK = "peak of RSS over the mesh"
_LATER = "the mesh turns (same colours)"
# Where the columns of the table below a panel start, as fractions of the panel's width.
_COLUMNS = {"together over": 0.0, "aligned": 0.27, "visible-first": 0.52, "packets": 0.77}
_LINE_POINTS = 10.5


def draw_multiframe_figure(table: pd.DataFrame) -> Figure:
    """One row a scene (and a value of any other setting that varies): a panel for each
    motion, milliseconds per frame over the number of frames, and one of the memory of all frames in MiB.

    A line is a way to trace the frames, at its best split for each number of frames; bars reach from the lower to the
    upper quartile over rounds. Bytes are those of the same points, read before anything else was built. Below a panel:
    how many times as fast the frames are together.
    """
    motions = [motion for motion in MOTIONS if column(table, "motion").eq(motion).any()]
    panels = make_panels(table, (*best_of(), "motion", "frames"))
    columns = len(motions) + 1
    figure, axes = make_figure(len(panels) * columns, columns=columns, panel_height=4.0)
    figure.set_figwidth(5.0 * columns)
    figure.set_layout_engine("constrained", h_pad=0.12, w_pad=0.1)
    for place, panel in enumerate(panels):
        row = axes[place * columns : (place + 1) * columns]
        for axis, motion in zip(row, motions, strict=False):
            set_panel_title(axis, f"{panel.title}: {MOTIONS[motion]}", panel.stands_for)
            _draw_times(axis, _of_motion(panel.rows, motion))
        set_panel_title(row[-1], f"{panel.scene}: memory", panel.stands_for)
        _draw_memory(row[-1], panel, motions)
    for axis in axes[columns - 1 : columns]:
        if len(motions) > 1:
            axis.plot([], [], color=BLACK, linestyle=DASHED, label=_LATER)
    add_legend(figure, axes, [*(way.label for way in WAYS), _PEAK, _LATER])
    write_foot(
        figure, table,
        "below a panel: how many times as fast all frames together are at their best split, [95 % interval of the "
        "median]; plan and build are not in these times; memory in the colours of the times is Embree's own account",
    )  # fmt: skip
    return figure


def _of_motion(rows: pd.DataFrame, motion: str) -> pd.DataFrame:
    return rows[column(rows, "motion").eq(motion).fillna(False).astype(bool)]


def _best_rows(rows: pd.DataFrame, way: Way) -> pd.DataFrame:
    """The best row of a way for every number of frames, ascending."""
    found = [best_row(of_count, way) for _, of_count in rows.groupby("frames", sort=True)]
    return pd.DataFrame([row for row in found if row is not None], columns=rows.columns).astype(rows.dtypes)


def _draw_times(axis: Axes, rows: pd.DataFrame) -> None:
    for way in WAYS:
        best = _best_rows(rows, way)
        frames = numbers(best, "frames")
        middle, low, high = (way.times_s(best, end) * MILLISECONDS / frames for end in ("", "_q1", "_q3"))
        draw_series(axis, frames, middle, way.style, (low, high), way.label)
    _finish(axis, rows, "time per frame in ms")
    lines = _write_speedups(axis, _best_rows(rows, TOGETHER))
    write_notes(axis, [*_say_wrong(rows), *say_unmeasured(rows, TOGETHER.label)], drop=38 + _LINE_POINTS * lines)


def _say_wrong(timed: pd.DataFrame) -> list[str]:
    """A line for each point with pixels that are wrong."""
    wrong = timed[timed["pixels_wrong"].gt(0).fillna(False).astype(bool)]
    return [
        f"{row['frames']} frames, {say_split(row)}: {row['pixels_wrong']:,} pixels wrong" for _, row in wrong.iterrows()
    ]


def _write_speedups(axis: Axes, best: pd.DataFrame) -> int:
    """A small table below the panel; returns its lines."""
    lines = [(BLACK, list(_COLUMNS))] if len(best) else []
    for _, row in best.iterrows():
        cells = [f"{row['frames']} frames, {say_split(row)}"]
        cells += [say_speedup(row, way) or "-" for way in (SEPARATE_FRAMES, VISIBLE_FRAMES, PACKETS)]
        lines.append((GREY, cells))
    write_table(axis, lines, list(_COLUMNS.values()), _LINE_POINTS, 7.5)
    return len(lines)


def _draw_memory(axis: Axes, panel: Panel, motions: list[str]) -> None:
    for place, motion in enumerate(motions):
        rows = _of_motion(panel.rows, motion)
        line = {"linestyle": DASHED, "markerfacecolor": "white"} if place else {}
        best = _best_rows(rows, TOGETHER)
        for way, name in ((TOGETHER, "embree_bytes"), (SEPARATE_FRAMES, "separate_embree_bytes")):
            draw_series(axis, numbers(best, "frames"), numbers(best, name) * MEBIBYTES, way.style | line, label="_")
        grown = (numbers(best, "peak_rss_bytes") - numbers(best, "rss_mesh_bytes")) * MEBIBYTES
        style = {"color": PURPLE, "marker": "^"} | line
        draw_series(axis, numbers(best, "frames"), grown, style, label="_" if place else _PEAK)
    _finish(axis, panel.rows, "memory of all frames in MiB")


def _finish(axis: Axes, rows: pd.DataFrame, quantity: str) -> None:
    """Frames on a logarithmic axis with a tick for each number, the ordinate from zero."""
    place_counts(axis, column(rows, "frames").dropna(), 1.25)
    if any(drawable(np.asarray(line.get_ydata(), np.float64)).any() for line in axis.get_lines()):
        axis.set_ylim(0, 1.08 * axis.dataLim.y1)
    else:
        axis.set_yticks([])
        say_nothing_measured(axis)
    axis.set_xlabel("frames")
    axis.set_ylabel(quantity)
    tidy_axis(axis)
