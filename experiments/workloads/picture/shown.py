"""Figure 3 of the paper: the scenes; and each traced aligned and per pixel, with the difference of the two images."""

from __future__ import annotations

import io
from collections.abc import Sequence
from functools import partial
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from PIL import Image

from atra.judge.compare import Verdict
from atra.judge.marks import COLOURS
from experiments.drawing.figure import FigureKind
from experiments.drawing.pages import stand_in_note
from experiments.drawing.style import GREY, SMALL, TIMES
from experiments.methods.naming import best_of
from experiments.results.table import workload_rows
from experiments.workloads.panels import draw_panels, make_panels
from experiments.workloads.picture import PICTURE
from experiments.workloads.picture.files import ScenePictures, read_pictures
from scenes.manifest import picture_restriction

_PANEL_INCHES = 3.6
_MARKERS = {Verdict.TIED: "s", Verdict.EDGE: "D", Verdict.WRONG: "X"}
_MEANINGS = {
    Verdict.TIED: "tied (another triangle, equally deep)",
    Verdict.EDGE: "edge (the ray grazes a triangle's edge)",
    Verdict.WRONG: "wrong",
}


def draw_scenes_figure(rows: pd.DataFrame, pictures: Sequence[ScenePictures], columns: int = 2) -> Figure:
    """One panel a scene: its picture, shaded from the aligned hits, its name and its number of triangles.

    A picture that is missing, or must not be passed on, is replaced by the reason.
    """
    panels = make_panels(rows, best_of())
    figure, _ = draw_panels(panels, partial(_draw_scene, pictures), columns, height=4.6)
    figure.supxlabel(_size(pictures) + "shaded from depth and triangle of each hit", fontsize=SMALL, color=GREY)
    return figure


def _draw_scene(pictures: Sequence[ScenePictures], axis: Axes, rows: pd.DataFrame) -> None:
    row = rows.iloc[0]
    found = [one for one in pictures if one.scene == row["scene"]]
    restriction = picture_restriction(str(row["scene"]))
    if row["status"] != "ok":
        _say_why(axis, f"{row['status']}: {row['error']}")
    elif restriction is not None:
        _say_why(axis, restriction)
    elif not found:
        _say_why(axis, "no picture: the records that hold it are not in this folder")
    else:
        axis.imshow(_decode(found[0].aligned))
    _frame_picture(axis)


def _say_why(axis: Axes, reason: str) -> None:
    axis.text(0.5, 0.5, fill(reason, 40), transform=axis.transAxes, ha="center", va="center", color=GREY)
    axis.set_box_aspect(1)


def draw_differences_figure(pictures: Sequence[ScenePictures]) -> Figure:
    """One row a scene: the picture from the aligned hits, the one from one ray per pixel, and where they differ."""
    row_inches = [_PANEL_INCHES * one.height / one.width for one in pictures] or [1.0]
    figure = Figure(figsize=(3 * _PANEL_INCHES + 0.4, sum(row_inches) + 0.6 * len(row_inches) + 0.8))
    figure.set_layout_engine("constrained", h_pad=0.09)
    FigureCanvasAgg(figure)
    if not pictures:
        why = "no pictures: the records that hold them are not in this folder"
        figure.text(0.5, 0.5, why, ha="center", va="center", color=GREY)
        return figure
    axes = figure.subplots(len(pictures), 3, squeeze=False, height_ratios=row_inches)
    for row, one in zip(axes, pictures, strict=True):
        _show(row[0], one.aligned, f"{one.scene} ({one.triangles:,} triangles)", _left_note(one))
        _show(row[1], one.pixel, "", "rtcIntersect1 per pixel")
        counts = f"{one.pixels_tied:,} tied, {one.pixels_edge:,} edge, {one.pixels_wrong:,} wrong"
        _show(row[2], one.difference, "", f"difference: {one.pixels_equal:,} pixels equal,\n{counts}")
    shown = [
        Line2D(
            [], [], linestyle="none", marker=_MARKERS[kind], markersize=6, color=np.array(colour) / 255,
            label=_MEANINGS[kind],
        )
        for kind, colour in COLOURS.items()
    ]  # fmt: skip
    figure.legend(handles=shown, loc="outside upper center", ncols=3, frameon=False)
    figure.supxlabel(_foot(pictures), fontsize=8, color=GREY)
    return figure


def _left_note(one: ScenePictures) -> str:
    note = stand_in_note(one.stands_for)
    return f"{note}\naligned" if note else "aligned"


def _show(axis: Axes, png: bytes, title: str, note: str) -> None:
    lines = note.count("\n") + 1
    axis.set_title(title, fontsize=11, loc="left", pad=6 + 12 * lines)
    axis.annotate(
        note, (0, 1), xytext=(0, 4), xycoords="axes fraction", textcoords="offset points", ha="left", va="bottom",
        fontsize=8.5, color=GREY,
    )  # fmt: skip
    axis.imshow(_decode(png))
    _frame_picture(axis)


def _frame_picture(axis: Axes) -> None:
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_edgecolor("#BBBBBB")
        spine.set_linewidth(0.6)


def _decode(png: bytes) -> NDArray[np.uint8]:
    """(H, W, 3) uint8."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def _foot(pictures: Sequence[ScenePictures]) -> str:
    marks = "marks in the difference are larger than their pixels"
    return f"{_size(pictures)}shaded from depth and triangle of each hit; {marks}"


def _size(pictures: Sequence[ScenePictures]) -> str:
    sizes = {(one.width, one.height) for one in pictures}
    return f"{pictures[0].width} {TIMES} {pictures[0].height} pixels, " if len(sizes) == 1 else ""


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    return workload_rows(table, PICTURE.name)


FIGURES = (
    FigureKind(
        "figure3", "Figure 3: the scenes",
        _rows, lambda rows, records, columns: draw_scenes_figure(rows, read_pictures(rows, records), columns),
        in_page=False,  # it has a section of pictures
    ),
    FigureKind(
        "figure3_differences",
        "Beside figure 3: the scenes from aligned hits and from single rays per pixel, and their difference",
        _rows, lambda rows, records, columns: draw_differences_figure(read_pictures(rows, records)),
        in_page=False,  # some must not be passed on
    ),
)  # fmt: skip
