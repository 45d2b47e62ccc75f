"""What is shown of several frames: best splits, two eyes, and time and memory over the number of frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from experiments.drawing.axes import draw_baseline, draw_series, label_axes, place_counts, say_nothing_measured
from experiments.drawing.bars import Bar
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes, write_table
from experiments.drawing.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, TIMES, VERMILLION
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, column, drawable, interval, numbers, say_number
from experiments.methods.naming import best_of, say_split
from experiments.results.settings import settings_that_vary
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.multiframe import MULTIFRAME
from experiments.workloads.panels import Bars, bars_figure, make_panels, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.series import OVER_PACKETS, choosing, say_ratio, say_unmeasured, say_wrong
from experiments.workloads.tables import best_rows_by, grid_of, narrow_table, plain, times, varying_words

_RATIOS = {
    "frame\nby frame": "speedup_vs_separate",
    "visible-\nfirst": "speedup_vs_visible_first",
    "raster-\niser": "speedup_vs_rasteriser",
    "packets": "speedup_vs_packets",
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The split with the largest gain over packets, and all gains there. rows: measured, of this workload."""
    headings = ("split", "all\nframes", *_RATIOS, "pixels\nwrong")
    best = narrow_table("best split of all frames together, and speed-up over", "scene, frames", headings)
    varying = settings_that_vary(rows, (*best_of(), "motion", "frames"))
    words = [[row["motion"], *varying_words(row, varying)] for _, row in rows.iterrows()]
    for motion, row, some in best_rows_by(rows, words, "frames"):
        best.add_row(
            plain(row["scene"], f"{row['frames']} frames", motion), grid_of(row), say_ms(row["render_time_s"]),
            *times(row, *_RATIOS.values()), str(some["pixels_wrong"].sum()),
        )  # fmt: skip
    yield best


@dataclass(frozen=True, eq=False)
class Way:
    """A way to trace several frames. time: columns of its time, with {} for an interval's end. over: beginning of
    those of the speed-up of all frames together over it, "" for that way itself."""

    label: str
    time: str
    over: str
    style: dict[str, Any]

    def times_s(self, rows: pd.DataFrame) -> NDArray[np.float64]:
        """(N,) float64 seconds of all frames, NaN where missing."""
        return numbers(rows, self.time.format(""))


TOGETHER = Way("all frames together", "render_time{}_s", "", {"color": BLUE, "marker": "o"})
SEPARATE_FRAMES = Way(
    "aligned, frame by frame", "separate_render_time{}_s", "speedup_vs_separate", {"color": ORANGE, "marker": "s"}
)
VISIBLE_FRAMES = Way(
    "visible-first, frame by frame", "visible_first_render_time{}_s", "speedup_vs_visible_first",
    {"color": VERMILLION, "marker": "D"},
)  # fmt: skip
RASTER_FRAMES = Way(
    "rasteriser, frame by frame", "rasteriser_render_time{}_s", "speedup_vs_rasteriser", {"color": BLACK, "marker": "*"}
)
PACKETS = Way(
    "fastest packets per pixel, frame by frame",
    "packets_render_time{}_s",
    "speedup_vs_packets",
    {"color": GREEN, "marker": "v"},
)
WAYS = (TOGETHER, SEPARATE_FRAMES, VISIBLE_FRAMES, RASTER_FRAMES, PACKETS)
"""In the order of the legends."""


def best_place(rows: pd.DataFrame, way: Way) -> int | None:
    """Index of the row with the best split for `way`: the largest ratio of packets to it in the same rounds.

    None where nothing was measured; any row for packets and the rasteriser, which have no split.
    """
    measured = rows["status"].eq("ok").to_numpy(bool) & drawable(way.times_s(rows))
    if not measured.any():
        return None
    ratios = choosing(rows, OVER_PACKETS) if way is TOGETHER else PACKETS.times_s(rows) / way.times_s(rows)
    return int(np.flatnonzero(measured)[np.argmax(ratios[measured])])


def say_speedup(row: pd.Series, way: Way) -> str:
    """The speed-up of all frames together over `way` at this row's split, with its interval; "" if unknown."""
    value, low, high = (row.get(f"{way.over}{end}") for end in ("", "_low", "_high"))
    if pd.isna(value):
        return ""
    return f"{value:.2f}{TIMES}" + ("" if pd.isna(low) or pd.isna(high) else f" [{low:.2f}, {high:.2f}]")


_LABELS = {
    TOGETHER: "both together", SEPARATE_FRAMES: "aligned, each eye", VISIBLE_FRAMES: "visible-first, each eye",
    RASTER_FRAMES: "rasteriser, each eye",
}  # fmt: skip


def draw_stereo_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene (and a value of any other setting that varies).

    A bar is the time of both images in milliseconds at the way's best split, its whisker the interval. Single rays and
    packets per pixel, eye by eye, are the two lines: the median of the points, with a band from quartile to quartile.
    """
    panels = make_panels(table, (*best_of(), "motion", "frames"))
    foot = (
        "right of a label: the time, and over both together at that split: packets (first bar), each eye (the others); "
        "without plan and build"
    )
    return bars_figure(
        panels, _bars, "time of both images in ms", columns, table, foot,
        draw_lines=_draw_baselines, legend=list(TIME_BASELINES), count=lambda rows: len(_LABELS),
    )  # fmt: skip


def _bars(rows: pd.DataFrame) -> Bars:
    bars = [_make_bar(rows, way, label) for way, label in _LABELS.items()]
    return bars, [*say_wrong(rows, ""), *say_unmeasured(rows, TOGETHER.label)]


def _draw_baselines(axis: Axes, rows: pd.DataFrame) -> float:
    if all(best_place(rows, way) is None for way in _LABELS):
        say_nothing_measured(axis)
    return max(
        draw_baseline(axis, numbers(rows, name) * MILLISECONDS, style, label, upright=True)
        for label, (name, style) in TIME_BASELINES.items()
    )


def _make_bar(rows: pd.DataFrame, way: Way, label: str) -> Bar:
    place = best_place(rows, way)
    if place is None:
        return Bar(label, nan, nan, nan, way.style["color"], "not measured")
    row = rows.iloc[place]
    value, low, high = (float(end[place]) for end in interval(rows, way.time, MILLISECONDS))
    ratio = say_ratio(row) if way is TOGETHER else say_speedup(row, way)
    split = "" if way is RASTER_FRAMES else say_split(row)
    name = ", ".join(filter(None, [label, split]))
    return Bar(name, value, low, high, way.style["color"], f"{say_number(value)} ms, {ratio}")


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
        middle, *ends = (times / frames for times in interval(best, way.time, MILLISECONDS))
        draw_series(axis, frames, middle, way.style, ends, way.label)
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
        say_nothing_measured(axis)
    label_axes(axis, "frames", quantity)


def _of_eyes(rows: pd.DataFrame) -> pd.DataFrame:
    return _of_motion(rows, "eyes")


FIGURES = (
    workload_figure(
        "stereo", "Time of the images of both eyes, together and eye by eye", MULTIFRAME, draw_stereo_figure, _of_eyes
    ),
    workload_figure(
        "multiframe", "Time per frame and memory over the number of frames, together and frame by frame", MULTIFRAME,
        draw_multiframe_figure, lambda rows: rows.drop(_of_eyes(rows).index),
    ),
)  # fmt: skip
