"""Several frames in one pass: time per frame and memory over the number of frames, beside frame by frame."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.drawing.axes import draw_series, place_counts, say_nothing_measured, tidy_axis
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes, write_table
from experiments.drawing.style import GREY, PURPLE
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, column, drawable, numbers
from experiments.methods.naming import best_of, say_split
from experiments.workloads.multiframe.frame_parts import (
    SEPARATE_FRAMES,
    TOGETHER,
    WAYS,
    Way,
    best_place,
    say_speedup,
)
from experiments.workloads.panels import make_panels
from experiments.workloads.series import say_unmeasured, say_wrong

MOTIONS = {"eyes": "two eyes", "walk": "the camera walks", "turn": "the mesh turns"}
"""In words, in the order of the panels."""

_PEAK = "peak of RSS over the mesh"
_HEADINGS = ("over aligned", "visible-first", "rasteriser", "packets")


def draw_multiframe_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """Two panels a scene and motion (and a value of any other setting that varies): milliseconds per frame over the
    number of frames, and the memory of all frames in MiB.

    A line is a way to trace the frames, at its best split for each number of frames, with bars over intervals. Bytes
    are those of the same points, read before anything else was built. Below a panel: how many times as fast the frames
    are together.
    """
    motions = [motion for motion in MOTIONS if column(table, "motion").eq(motion).any()]
    panels = make_panels(table, (*best_of(), "motion", "frames"))
    pairs = [
        (panel, motion, rows) for panel in panels for motion in motions if len(rows := _of_motion(panel.rows, motion))
    ]
    figure, axes = make_figure(2 * len(pairs), columns, panel_height=4.4)
    for (panel, motion, rows), left, right in zip(pairs, axes[::2], axes[1::2], strict=True):
        set_panel_title(left, f"{panel.title}: {MOTIONS[motion]}", panel.stands_for)
        _draw_times(left, rows)
        set_panel_title(right, f"{panel.scene}: {MOTIONS[motion]}, memory", panel.stands_for)
        _draw_memory(right, rows)
    add_legend(figure, axes, [*(way.label for way in WAYS), _PEAK])
    write_foot(
        figure, table,
        "below a panel: how many times as fast all frames together are at their best split, with intervals; plan and "
        "build are not in these times; memory in the colours of the times is Embree's own account",
    )  # fmt: skip
    return figure


def _of_motion(rows: pd.DataFrame, motion: str) -> pd.DataFrame:
    return rows[column(rows, "motion").eq(motion).fillna(False).astype(bool)]


def _best_rows(rows: pd.DataFrame, way: Way) -> pd.DataFrame:
    """The best row of a way for every number of frames, ascending."""
    found = []
    for _, places in sorted(rows.groupby("frames").indices.items()):
        place = best_place(rows.iloc[places], way)
        if place is not None:
            found.append(places[place])
    return rows.iloc[found]


def _draw_times(axis: Axes, rows: pd.DataFrame) -> None:
    for way in WAYS:
        best = _best_rows(rows, way)
        frames = numbers(best, "frames")
        middle, low, high = (way.times_s(best, end) * MILLISECONDS / frames for end in ("", "_low", "_high"))
        draw_series(axis, frames, middle, way.style, (low, high), way.label)
    _finish(axis, rows, "time per frame in ms")
    entries = [
        (GREY, f"{row['frames']} frames, {say_split(row)}", [say_speedup(row, way) or "-" for way in WAYS[1:]])
        for _, row in _best_rows(rows, TOGETHER).iterrows()
    ]
    wrong = [line for frames, of_count in rows.groupby("frames") for line in say_wrong(of_count, f"{frames} frames")]
    write_notes(axis, [*wrong, *say_unmeasured(rows, TOGETHER.label)], write_table(axis, _HEADINGS, entries))


def _draw_memory(axis: Axes, rows: pd.DataFrame) -> None:
    best = _best_rows(rows, TOGETHER)
    for way, name in ((TOGETHER, "embree_bytes"), (SEPARATE_FRAMES, "separate_embree_bytes")):
        draw_series(axis, numbers(best, "frames"), numbers(best, name) * MEBIBYTES, way.style, label="_")
    grown = (numbers(best, "peak_rss_bytes") - numbers(best, "rss_mesh_bytes")) * MEBIBYTES
    draw_series(axis, numbers(best, "frames"), grown, {"color": PURPLE, "marker": "^"}, label=_PEAK)
    _finish(axis, rows, "memory of all frames in MiB")


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
