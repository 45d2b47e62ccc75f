"""Figures as values: panels of lines, bars, cells or pictures, and what a page tells beside them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.missing import Missing
from experiments.drawing.values import drawable

Array = NDArray[np.float64]
Style = Mapping[str, Any]
"""Colour, marker and linestyle, as Matplotlib calls them."""


@dataclass(frozen=True)
class Axis:
    """label: the quantity with its unit. scale: "linear" from zero; "log"; "ticks", which is logarithmic with a tick at
    every value; "counts", which is linear to 1 and then logarithmic; "days", since 1970. say: a tick -> its text.
    low: where the axis begins, None = by the data."""

    label: str
    scale: Literal["linear", "log", "ticks", "counts", "days"] = "log"
    say: Callable[[float], str] = "{:,.10g}".format
    low: float | None = None


@dataclass(frozen=True, eq=False)
class Line:
    """A series. x, y, and both ends of its interval: (N,) float64 in units of the axes, in any order; values that an
    axis cannot show are left out. label: in the legend. thin: it stands behind the others."""

    label: str
    x: Array
    y: Array
    style: Style
    interval: tuple[Array, Array] | None = None
    thin: bool = False


@dataclass(frozen=True)
class Level:
    """A line across at the value of something without an abscissa, and a band from `low` to `high`, NaN = none."""

    label: str
    value: float
    style: Style
    low: float = np.nan
    high: float = np.nan


def median_level(label: str, values: Array, style: Style) -> list[Level]:
    """The level at the median of what can be drawn, its band from quartile to quartile; empty without any."""
    known = values[drawable(values)]
    if len(known) == 0:
        return []
    low, median, high = np.quantile(known, [0.25, 0.5, 0.75])
    return [Level(label, float(median), style, *((float(low), float(high)) if high > low else ()))]


@dataclass(frozen=True)
class Mark:
    """One place in a panel. label: in the legend, "" = none."""

    label: str
    x: float
    y: float
    style: Style


@dataclass(frozen=True)
class Bar:
    """value, and the ends of its interval: in units of the axis, NaN where missing. text: its numbers in words, for the
    page. parts: it is stacked of these, as `Figure.parts` calls them. series: in the legend, where bars belong to
    several."""

    label: str
    value: float
    low: float
    high: float
    color: str
    text: str
    faint: bool = False
    parts: tuple[float, ...] = ()
    series: str = ""


@dataclass(frozen=True)
class Frame:
    """A frame around a cell of a grid. inset: it lies inside of other frames."""

    label: str
    column: int
    row: int
    style: Style
    inset: bool = False


@dataclass(frozen=True, eq=False)
class Cells:
    """A grid of values. columns, rows: what their ticks say, from the left and from below. values: (R, C) float64, NaN
    where missing. texts: of the cells. low, high: ends of the colours."""

    columns: Sequence[int]
    rows: Sequence[int]
    values: Array
    texts: Sequence[Sequence[str]]
    low: float
    high: float
    frames: Sequence[Frame] = ()


@dataclass(frozen=True, eq=False)
class Panel:
    """What one panel shows. stands_for: the scene of the paper that its scene replaces. x, y: where they differ from
    the figure's. crosses: points without a value. notes, table: for the page, `Figure.headings` over the latter."""

    title: str = ""
    stands_for: str | None = None
    lines: Sequence[Line] = ()
    levels: Sequence[Level] = ()
    marks: Sequence[Mark] = ()
    bars: Sequence[Bar] = ()
    cells: Cells | None = None
    picture: NDArray[np.uint8] | None = None
    x: Axis | None = None
    y: Axis | None = None
    crosses: Sequence[Missing] = ()
    notes: Sequence[str] = ()
    table: Sequence[Sequence[str]] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing of it is measured."""
        drawn = [
            *(np.isfinite(line.y).any() for line in self.lines),
            *(np.isfinite(bar.value) or bar.parts for bar in self.bars),
        ]
        has_cells = self.cells is not None and bool(np.isfinite(self.cells.values).any())
        return not (any(drawn) or self.levels or has_cells or self.picture is not None)

    @property
    def told(self) -> list[str]:
        """Lines of text for the page."""
        return [*self.notes, *(cross.words for cross in self.crosses)]

    @property
    def told_rows(self) -> Sequence[Sequence[str]]:
        """The table for the page; of bars their labels and numbers."""
        return self.table or [(bar.label, bar.text) for bar in self.bars if bar.text]


def stand_in_note(stands_for: str | None) -> str:
    """What must stand at every picture and panel of a stand-in; "" for any other scene."""
    return f"stand-in for {stands_for}, not that scene" if stands_for else ""


@dataclass(frozen=True, eq=False)
class Figure:
    """kind: what its panels hold. quantity: what stands in cells, in words. legend: labels in their order; those that
    do not occur are left out. parts: names of the parts of bars. provenance: machine, date, threads and pixels in a
    line. notes: for the page, of all panels. headings: of the panels' tables. columns: panels side by side."""

    kind: Literal["lines", "bars", "cells", "pictures"]
    panels: Sequence[Panel]
    x: Axis | None = None
    y: Axis | None = None
    quantity: str = ""
    legend: Sequence[str] = ()
    parts: Sequence[str] = ()
    provenance: str = ""
    notes: Sequence[str] = ()
    headings: Sequence[str] = ()
    columns: int = 2

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn in any panel: crosses of missing points are nothing."""
        return all(panel.is_empty for panel in self.panels)

    @property
    def words(self) -> str:
        """All that is said in it and beside it."""
        said = [self.provenance, self.quantity, *self.notes, *self.headings]
        for panel in self.panels:
            said += [
                panel.title,
                stand_in_note(panel.stands_for),
                *panel.told,
                *(level.label for level in panel.levels),
            ]
            said += [cell for row in panel.told_rows for cell in row]
        return "\n".join(said)


Make = Callable[[pd.DataFrame, Path], Figure]
"""Rows of the table, the folder of the sweep -> figure."""


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
    make: Make
    per_packet_width: bool = False
    in_page: bool = True

    @property
    def file_names(self) -> str:
        """A pattern of the names of its files, whatever rows it is drawn of."""
        return rf"{re.escape(self.name)}(_single_rays|_packets_of_\d+)?\.(png|svg)"


def of_table(make: Callable[[pd.DataFrame], Figure]) -> Make:
    """A figure that needs no more than rows."""
    return lambda rows, folder: make(rows)


@dataclass(frozen=True, eq=False)
class NamedFigure:
    """A figure of a sweep. point_ids: of the points it shows."""

    name: str
    caption: str
    figure: Figure
    point_ids: frozenset[str]
    in_page: bool = True


def make_figures(kind: FigureKind, rows: pd.DataFrame, folder: Path) -> Iterator[NamedFigure]:
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
            figure = kind.make(part, folder)
            if not figure.is_empty:
                yield NamedFigure(name, caption, figure, frozenset(part["point_id"]), kind.in_page)
