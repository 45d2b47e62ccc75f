"""Figure 3 of the paper: the scenes; and each traced aligned and per pixel, with the difference of the two images."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from PIL import Image

from atra.judge.compare import Verdict
from atra.judge.marks import COLOURS
from experiments.drawing.figure import Figure, FigureKind, Mark, Panel
from experiments.methods.naming import best_of
from experiments.results.table import workload_rows
from experiments.workloads.panels import figure_of, make_panels
from experiments.workloads.picture import PICTURE
from experiments.workloads.picture.files import ScenePictures, read_pictures
from scenes.manifest import picture_restriction

_SHAPES = {Verdict.TIED: "s", Verdict.EDGE: "D", Verdict.WRONG: "X"}
_MEANINGS = {
    Verdict.TIED: "tied (another triangle, equally deep)",
    Verdict.EDGE: "edge (the ray grazes a triangle's edge)",
    Verdict.WRONG: "wrong",
}
_SHADED = "shaded from depth and triangle of each hit"


def scenes_figure(rows: pd.DataFrame, pictures: Sequence[ScenePictures]) -> Figure:
    """One panel a scene: its picture, shaded from the aligned hits, its name and its number of triangles.

    Where a picture is missing, or must not be passed on, the notes say why.
    """
    known = {picture.scene: picture for picture in pictures}
    panels = []
    for panel in make_panels(rows, best_of()):
        why = _why_none(panel.rows.iloc[0], known)
        shown = Panel(notes=[f"{panel.scene}: {why}"]) if why else Panel(picture=_decode(known[panel.scene].aligned))
        panels.append(panel.panel(shown))
    return figure_of("pictures", panels, rows, _SHADED)


def _why_none(row: pd.Series, known: dict[str, ScenePictures]) -> str:
    """Why there is no picture to show, "" where there is."""
    if row["status"] != "ok":
        return f"{row['status']}: {row['error']}"
    missing = "" if row["scene"] in known else "no picture: neither a record nor a kept file holds it"
    return picture_restriction(str(row["scene"])) or missing


def differences_figure(rows: pd.DataFrame, pictures: Sequence[ScenePictures]) -> Figure:
    """One row a scene: the picture from the aligned hits, the one from one ray per pixel, and where they differ."""
    panels = []
    for shown in pictures:
        title, name = f"{shown.scene} ({shown.triangles:,} triangles)", shown.stands_for
        counts = f"{shown.pixels_tied:,} tied, {shown.pixels_edge:,} edge, {shown.pixels_wrong:,} wrong"
        told = f"{shown.scene}: {shown.pixels_equal:,} pixels equal, {counts}"
        panels += [
            Panel(f"{title}, aligned", name, picture=_decode(shown.aligned)),
            Panel("rtcIntersect1 per pixel", picture=_decode(shown.pixel)),
            Panel("difference", picture=_decode(shown.difference), notes=[told], marks=_MARKS),
        ]
    marks = "marks in the difference are larger than their pixels"
    return figure_of("pictures", panels, rows, f"{_SHADED}; {marks}", legend=list(_MEANINGS.values()), columns=3)


_MARKS = [
    Mark(_MEANINGS[kind], 0.0, 0.0, {"marker": _SHAPES[kind], "color": tuple(np.array(color) / 255)})
    for kind, color in COLOURS.items()
]


def _decode(png: bytes) -> NDArray[np.uint8]:
    """(H, W, 3) uint8."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    return workload_rows(table, PICTURE.name)


FIGURES = (
    FigureKind(
        "figure3", "Figure 3: the scenes", _rows,
        lambda rows, folder: scenes_figure(rows, read_pictures(rows, folder)),
        in_page=False,  # it has a section of pictures
    ),
    FigureKind(
        "figure3_differences",
        "Beside figure 3: the scenes from aligned hits and from single rays per pixel, and their difference", _rows,
        lambda rows, folder: differences_figure(rows, read_pictures(rows, folder)),
        in_page=False,  # some must not be passed on
    ),
)  # fmt: skip
