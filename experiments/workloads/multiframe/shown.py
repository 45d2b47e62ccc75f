"""What is shown of several frames: best splits, two eyes, and time and memory over the number of frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.table import Table

from experiments.drawing.figure import Axis, Bar, Figure, Line, Panel
from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, column, drawable, interval, numbers, say_number
from experiments.methods.naming import best_of, say_split
from experiments.results.settings import settings_that_vary
from experiments.workloads.baselines import TIME_BASELINES
from experiments.workloads.multiframe import MULTIFRAME
from experiments.workloads.panels import PanelRows, figure_of, make_panels, read_panels, workload_figure
from experiments.workloads.resources import say_ms
from experiments.workloads.series import OVER_PACKETS, choosing, say_ratio, say_unmeasured, say_wrong, time_levels
from experiments.workloads.tables import best_rows_by, best_table, cell, grid_of, varying_words

_COLUMNS = {
    "split": grid_of,
    "all\nframes": lambda row: say_ms(row["render_time_s"]),
    "frame\nby frame": cell("speedup_vs_separate"),
    "visible-\nfirst": cell("speedup_vs_visible_first"),
    "raster-\niser": cell("speedup_vs_rasteriser"),
    "packets": cell("speedup_vs_packets"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """The split with the largest gain over packets, and all gains there. rows: measured, of this workload."""
    varying = settings_that_vary(rows, (*best_of(), "motion", "frames"))
    words = [[row["motion"], *varying_words(row, varying)] for _, row in rows.iterrows()]
    best = (([f"{row['frames']} frames", said], row, some) for said, row, some in best_rows_by(rows, words, "frames"))
    title = "best split of all frames together, and speed-up over"
    yield best_table(title, "scene, frames", best, _COLUMNS, "pixels_wrong")


@dataclass(frozen=True, eq=False)
class Way:
    """A way to trace several frames. of_eyes: its label where the frames are two eyes. time: columns of its time, with
    {} for an interval's end. over: beginning of those of the speed-up of all frames together over it."""

    label: str
    of_eyes: str
    time: str
    over: str
    style: dict[str, Any]

    def times_s(self, rows: pd.DataFrame) -> NDArray[np.float64]:
        """(N,) float64 seconds of all frames, NaN where missing."""
        return numbers(rows, self.time.format(""))


def _separate(label: str, name: str, color: str, marker: str) -> Way:
    time, over = f"{name}_render_time{{}}_s", f"speedup_vs_{name}"
    return Way(f"{label}, frame by frame", f"{label}, each eye", time, over, {"color": color, "marker": marker})


TOGETHER = Way("all frames together", "both together", "render_time{}_s", "", {"color": BLUE, "marker": "o"})
SEPARATE_FRAMES = _separate("aligned", "separate", ORANGE, "s")
VISIBLE_FRAMES = _separate("visible-first", "visible_first", VERMILLION, "D")
RASTER_FRAMES = _separate("rasteriser", "rasteriser", BLACK, "*")
PACKETS = _separate("fastest packets per pixel", "packets", GREEN, "v")
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


def stereo_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies).

    A bar is the time of both images in milliseconds at the way's best split, its whisker the interval. Single rays and
    packets per pixel, eye by eye, are the two lines: the median of the points, with a band from quartile to quartile.
    """
    panels = read_panels(make_panels(table, (*best_of(), "motion", "frames")), _bars)
    told = "the time, and over both together at that split: packets (first bar), each eye (the others)"
    return figure_of(
        "bars", panels, table, "without plan and build", x=Axis("time of both images in ms", "linear"),
        legend=list(TIME_BASELINES), headings=("", told),
    )  # fmt: skip


def _bars(rows: pd.DataFrame) -> Panel:
    notes = [*say_wrong(rows, ""), *say_unmeasured(rows, TOGETHER.label)]
    return Panel(bars=[_bar(rows, way) for way in WAYS[:-1]], levels=time_levels(rows), notes=notes)


def _bar(rows: pd.DataFrame, way: Way) -> Bar:
    place = best_place(rows, way)
    if place is None:
        return Bar(way.of_eyes, nan, nan, nan, way.style["color"], "not measured")
    row = rows.iloc[place]
    value, low, high = (float(end[place]) for end in interval(rows, way.time, MILLISECONDS))
    name = ", ".join(filter(None, [way.of_eyes, "" if way is RASTER_FRAMES else say_split(row)]))
    text = f"{say_number(value)} ms, {say_ratio(row, way.over or OVER_PACKETS)}"
    return Bar(name, value, low, high, way.style["color"], text)


MOTIONS = {"eyes": "two eyes", "walk": "the camera walks", "turn": "the mesh turns"}
"""In words, in the order of the panels."""

_PEAK = "peak of RSS over the mesh"
_HEADINGS = ("times as fast together", "aligned, frame by frame", "visible-first", "rasteriser", "packets")


def multiframe_figure(table: pd.DataFrame) -> Figure:
    """Two panels a scene and motion (and a value of any other setting that varies): milliseconds per frame over the
    number of frames, and the memory of all frames in MiB.

    A line is a way to trace the frames, at its best split for each number of frames, with bars over intervals. Bytes
    are those of the same points, read before anything else was built. Beside a panel: how many times as fast the frames
    are together.
    """
    motions = [motion for motion in MOTIONS if column(table, "motion").eq(motion).any()]
    panels: list[Panel] = []
    for panel in make_panels(table, (*best_of(), "motion", "frames")):
        for motion in motions:
            if len(rows := _of_motion(panel.rows, motion)):
                moving = PanelRows(panel.scene, panel.details, rows)
                panels.append(moving.panel(_times(rows), f": {MOTIONS[motion]}"))
                panels.append(moving.panel(_memory(rows), f": {MOTIONS[motion]}, memory"))
    return figure_of(
        "lines", panels, table, "with intervals, at the best split; plan and build are not in these times; memory in "
        "the colours of the times is Embree's own account",
        x=Axis("frames", "ticks"), legend=[*(way.label for way in WAYS), _PEAK], headings=_HEADINGS,
    )  # fmt: skip


def _of_motion(rows: pd.DataFrame, motion: str) -> pd.DataFrame:
    return rows[column(rows, "motion").eq(motion).fillna(False).astype(bool)]


def _best_rows(rows: pd.DataFrame, way: Way) -> pd.DataFrame:
    """The best row of a way for every number of frames, ascending."""
    counts = [places for _, places in sorted(rows.groupby("frames").indices.items())]
    best = ((places, best_place(rows.iloc[places], way)) for places in counts)
    return rows.iloc[[places[place] for places, place in best if place is not None]]


def _times(rows: pd.DataFrame) -> Panel:
    lines = []
    for way in WAYS:
        best = _best_rows(rows, way)
        frames = numbers(best, "frames")
        middle, low, high = (times / frames for times in interval(best, way.time, MILLISECONDS))
        lines.append(Line(way.label, frames, middle, way.style, (low, high)))
    table = [
        (f"{row['frames']} frames, {say_split(row)}", *(say_ratio(row, way.over) or "-" for way in WAYS[1:]))
        for _, row in _best_rows(rows, TOGETHER).iterrows()
    ]
    wrong = [line for frames, of_count in rows.groupby("frames") for line in say_wrong(of_count, f"{frames} frames")]
    notes = [*wrong, *say_unmeasured(rows, TOGETHER.label)]
    return Panel(lines=lines, notes=notes, table=table, y=Axis("time per frame in ms", "linear"))


def _memory(rows: pd.DataFrame) -> Panel:
    best = _best_rows(rows, TOGETHER)
    frames = numbers(best, "frames")
    grown = (numbers(best, "peak_rss_bytes") - numbers(best, "rss_mesh_bytes")) * MEBIBYTES
    lines = [
        Line(way.label, frames, numbers(best, name) * MEBIBYTES, way.style)
        for way, name in ((TOGETHER, "embree_bytes"), (SEPARATE_FRAMES, "separate_embree_bytes"))
    ]
    lines.append(Line(_PEAK, frames, grown, {"color": PURPLE, "marker": "^"}))
    return Panel(lines=lines, y=Axis("memory of all frames in MiB", "linear"))


def _of_eyes(rows: pd.DataFrame) -> pd.DataFrame:
    return _of_motion(rows, "eyes")


FIGURES = (
    workload_figure(
        "stereo", "Time of the images of both eyes, together and eye by eye", MULTIFRAME, stereo_figure, _of_eyes
    ),
    workload_figure(
        "multiframe", "Time per frame and memory over the number of frames, together and frame by frame", MULTIFRAME,
        multiframe_figure, lambda rows: rows.drop(_of_eyes(rows).index),
    ),
)  # fmt: skip
