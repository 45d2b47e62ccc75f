"""Figure 3 of the paper: the scenes, shaded from the hits of aligned rays."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import pandas as pd
from PIL import Image

from experiments.drawing.figure import Figure, FigureKind, Panel
from experiments.methods.naming import best_of
from experiments.results.table import workload_rows
from experiments.workloads.panels import figure_of, make_panels
from experiments.workloads.picture import PICTURE
from experiments.workloads.picture.files import ScenePictures, read_pictures
from scenes.manifest import picture_restriction


def scenes_figure(rows: pd.DataFrame, pictures: Sequence[ScenePictures]) -> Figure:
    """One panel a scene: its picture, shaded from the aligned hits, its name and its number of triangles.

    Where a picture is missing, or must not be passed on, the notes say why.
    """
    known = {picture.scene: picture.aligned for picture in pictures}
    panels = []
    for panel in make_panels(rows, best_of()):
        why = _why_none(panel.rows.iloc[0], known)
        shown = Panel(notes=[f"{panel.scene}: {why}"])
        if not why:
            shown = Panel(picture=np.asarray(Image.open(io.BytesIO(known[panel.scene])).convert("RGB")))
        panels.append(panel.panel(shown))
    return figure_of("pictures", panels, rows, "shaded from depth and triangle of each hit")


def _why_none(row: pd.Series, known: dict[str, bytes]) -> str:
    """Why there is no picture to show, "" where there is."""
    if row["status"] != "ok":
        return f"{row['status']}: {row['error']}"
    missing = "" if row["scene"] in known else "no picture: neither a record nor a kept file holds it"
    return picture_restriction(str(row["scene"])) or missing


FIGURES = (
    FigureKind(
        "figure3", "Figure 3: the scenes", lambda table: workload_rows(table, PICTURE.name),
        lambda rows, folder: scenes_figure(rows, read_pictures(rows, folder)),
        in_page=False,  # it has a section of pictures
    ),
)  # fmt: skip
