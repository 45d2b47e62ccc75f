"""Figures as values: what they are called, whose rows they draw, and the contents of their files."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib import figure as mpl
from matplotlib.text import Text

Draw = Callable[[pd.DataFrame, Path, int], mpl.Figure]
"""Rows of the table, the folder of the records, and how many panels stand side by side -> figure."""

_WIDE, _NARROW = 2, 1
"""Panels side by side on a wide page and on a narrow one."""


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

    @property
    def file_names(self) -> str:
        """A pattern of the names of its files, whatever rows it is drawn of."""
        return rf"{re.escape(self.name)}(_single_rays|_packets_of_\d+)?\.(png|svg)"


@dataclass(frozen=True)
class DrawnFigure:
    """A figure as the contents of its files. narrow: an SVG of one column, for a page as narrow as 400 px.
    point_ids: of the points it shows. words: all that is written in it."""

    name: str
    caption: str
    png: bytes
    svg: bytes
    narrow: bytes
    point_ids: frozenset[str]
    in_page: bool = True
    words: str = ""


def of_table(draw: Callable[[pd.DataFrame, int], mpl.Figure]) -> Draw:
    """A figure that needs no records."""
    return lambda rows, records, columns: draw(rows, columns)


def draw_figure(kind: FigureKind, rows: pd.DataFrame, records: Path) -> Iterator[DrawnFigure]:
    """The figure of these rows, or one for each packet width; none where no point was measured, or it would be empty.

    Rows without a packet width, as of methods that do not tell theirs, are part of every one.
    """
    known = rows["packet_width"].fillna(0)
    widths = sorted(int(width) for width in known[known > 0].unique())
    if not kind.per_packet_width or len(widths) < 2:
        parts = [(kind.name, kind.caption, rows)]
    else:
        named = {width: "single rays" if width == 1 else f"packets of {width}" for width in widths}
        parts = [
            (f"{kind.name}_{rays.replace(' ', '_')}", f"{kind.caption}; {rays}", rows[known.isin((width, 0))])
            for width, rays in named.items()
        ]
    for name, caption, part in parts:
        if (part["status"] == "ok").any():
            wide = kind.draw(part, records, _WIDE)
            if is_empty(wide):
                continue
            narrow = _svg(kind.draw(part, records, _NARROW)) if kind.in_page else b""
            words = "\n".join(text.get_text() for text in wide.findobj(Text))
            yield DrawnFigure(
                name, caption, _png(wide), _svg(wide), narrow, frozenset(part["point_id"]), kind.in_page, words
            )


def is_empty(figure: mpl.Figure) -> bool:
    """Whether nothing is drawn in any panel. Crosses of missing points, which hang on a panel's edge, are nothing."""
    return not any(axis.get_visible() and np.isfinite(axis.dataLim.intervaly).all() for axis in figure.axes)


def _png(figure: mpl.Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def _svg(figure: mpl.Figure) -> bytes:
    buffer = io.BytesIO()
    # A fixed salt and no date keep the SVG of equal tables equal.
    with matplotlib.rc_context({"svg.hashsalt": "atra", "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", dpi=72, metadata={"Date": None})  # its dots are those of pictures alone
    return buffer.getvalue()


def figure_files(figure: DrawnFigure) -> dict[str, bytes]:
    """The contents of `<name>.png` and `<name>.svg`, by name."""
    return {f"{figure.name}.png": figure.png, f"{figure.name}.svg": figure.svg}
