"""Figures as values: what they are called, whose rows they draw, and the contents of their files."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import pandas as pd
from matplotlib import figure as mpl

from atra.files import write_atomically

Draw = Callable[[pd.DataFrame, Path], mpl.Figure]
"""Rows of the table and the folder of the records -> figure."""


@dataclass(frozen=True)
class FigureKind:
    """name: of the files. caption: what it shows, the paper's number first where it has the figure.

    rows: of a whole table those that it can draw; none where it has nothing to show. A sweep may name the grids whose
    points it draws instead. per_packet_width: packets of another width are another figure. in_page: it stands among
    the page's figures.
    """

    name: str
    caption: str
    rows: Callable[[pd.DataFrame], pd.DataFrame]
    draw: Draw
    per_packet_width: bool = False
    in_page: bool = True


@dataclass(frozen=True)
class DrawnFigure:
    """A figure as the contents of its files. point_ids: of the points it shows."""

    name: str
    caption: str
    png: bytes
    svg: bytes
    point_ids: frozenset[str]
    in_page: bool = True


def of_table(draw: Callable[[pd.DataFrame], mpl.Figure]) -> Draw:
    """A figure that needs no records."""
    return lambda rows, records: draw(rows)


def draw_figure(kind: FigureKind, rows: pd.DataFrame, records: Path) -> Iterator[DrawnFigure]:
    """The figure of these rows, or one for each packet width; nothing where no point was measured."""
    widths = sorted(int(width) for width in rows["packet_width"].dropna().unique())
    if not kind.per_packet_width or len(widths) < 2:
        parts = [(kind.name, kind.caption, rows)]
    else:
        named = {width: "single rays" if width == 1 else f"packets of {width}" for width in widths}
        parts = [
            (f"{kind.name}_{rays.replace(' ', '_')}", f"{kind.caption}; {rays}", rows[rows["packet_width"] == width])
            for width, rays in named.items()
        ]
    for name, caption, part in parts:
        if (part["status"] == "ok").any():
            png, svg = _files(kind.draw(part, records))
            yield DrawnFigure(name, caption, png, svg, frozenset(part["point_id"]), kind.in_page)


def _files(figure: mpl.Figure) -> tuple[bytes, bytes]:
    """PNG and SVG."""
    png, svg = io.BytesIO(), io.BytesIO()
    # A fixed salt and no date keep the SVG of equal tables equal.
    with matplotlib.rc_context({"svg.hashsalt": "atra", "svg.fonttype": "path"}):
        figure.savefig(png, format="png", dpi=150)
        figure.savefig(svg, format="svg", dpi=72, metadata={"Date": None})  # its dots are those of pictures alone
    return png.getvalue(), svg.getvalue()


def write_figure(folder: Path, figure: DrawnFigure) -> None:
    """`<name>.png` and `<name>.svg` in `folder`."""
    write_atomically(folder / f"{figure.name}.png", figure.png)
    write_atomically(folder / f"{figure.name}.svg", figure.svg)
