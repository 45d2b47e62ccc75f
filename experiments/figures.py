"""Which figure a sweep draws, and writing it to files."""

from __future__ import annotations

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import matplotlib
import pandas as pd
from matplotlib import figure as mpl

from atra.records import write_atomically
from experiments.configuration import Figure
from experiments.grid_figure import draw_grid_figure
from experiments.split_figure import draw_split_figure

# The file's name and the drawing of each; the paper's numbers where it has the figure.
_FIGURES: dict[Figure, tuple[str, Callable[[pd.DataFrame], mpl.Figure]]] = {
    Figure.horizontal: ("figure5", draw_split_figure),
    Figure.vertical: ("figure5_vertical", partial(draw_split_figure, axis_name="split_y")),
    Figure.grid: ("figure4", draw_grid_figure),
}


def write_figure(folder: Path, kind: Figure, table: pd.DataFrame) -> None:
    """Draw the table's points into a PNG and an SVG; writes nothing for `Figure.none` or if no point was measured."""
    if kind is Figure.none or not (table["status"] == "ok").any():
        return
    name, draw = _FIGURES[kind]
    figure = draw(table)
    for suffix in ("png", "svg"):
        buffer = io.BytesIO()
        # A fixed salt and no date keep the SVG of equal tables equal.
        with matplotlib.rc_context({"svg.hashsalt": "atra", "svg.fonttype": "path"}):
            figure.savefig(buffer, format=suffix, dpi=150, metadata={"Date": None} if suffix == "svg" else None)
        write_atomically(folder / f"{name}.{suffix}", buffer.getvalue())
