"""Figure -> PNG and SVG: lines over an axis, bars, a grid of cells, pictures."""

from __future__ import annotations

import io
from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib import figure as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from experiments.drawing.axes import scale_axis, tidy_axes
from experiments.drawing.figure import Array, Bar, Figure, Level, Line, NamedFigure, Panel, stand_in_note
from experiments.drawing.style import BLACK, GREY, PANEL_INCHES, PARTS, SMALL
from experiments.drawing.values import drawable

# A fixed salt and no date keep the SVG of equal tables equal.
_STYLE = {
    "font.size": SMALL, "axes.titlesize": SMALL, "axes.labelsize": SMALL, "axes.linewidth": 0.6,
    "lines.linewidth": 1.4, "lines.markersize": 4.0, "svg.hashsalt": "atra", "svg.fonttype": "path",
}  # fmt: skip
_CHARACTERS_PER_INCH = 11.0
"""Characters of small text that fit an inch."""
_TITLE_CHARACTERS, _BAR_CHARACTERS = 35, 40
"""Longest lines of a panel's title and of a bar's label."""
_MANY_POINTS = 500
"""A line of more points is kept as dots in an SVG."""
_LINE_INCHES, _BAR_INCHES, _CELL_INCHES = 0.17, 0.23, 0.45
"""Heights of a line of text, and of a bar without its label; both sides of a cell."""
_PAIRED_CELLS = 5
"""Grids of more columns stand alone in their row."""


def figure_files(named: NamedFigure) -> dict[str, bytes]:
    """The contents of `<name>.png` and `<name>.svg`, by name."""
    return {f"{named.name}.png": render(named.figure, "png"), f"{named.name}.svg": render(named.figure, "svg")}


def render(figure: Figure, form: str) -> bytes:
    """The contents of a file. form: "png" or "svg"."""
    buffer = io.BytesIO()
    with matplotlib.rc_context(_STYLE):
        _sheet(figure).savefig(buffer, format=form, dpi=150, metadata={"Date": None} if form == "svg" else None)
    return buffer.getvalue()


def draw(figure: Figure) -> mpl.Figure:
    """The figure as Matplotlib has it."""
    with matplotlib.rc_context(_STYLE):
        return _sheet(figure)


def _sheet(figure: Figure) -> mpl.Figure:
    panels = figure.panels
    cells = max((len(panel.cells.columns) for panel in panels if panel.cells is not None), default=0)
    columns = 1 if cells > _PAIRED_CELLS else max(1, min(figure.columns, len(panels)))
    width = max(PANEL_INCHES, 0.8 + _CELL_INCHES * cells)
    rows = [panels[start : start + columns] for start in range(0, len(panels), columns)] or [()]
    heights = [_height(figure, row) for row in rows]
    sheet = mpl.Figure(figsize=(width * columns, sum(heights) + 0.8), layout="constrained")
    FigureCanvasAgg(sheet)
    axes = list(sheet.subplots(len(rows), columns, squeeze=False, height_ratios=heights).ravel())
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, panel in zip(axes, panels, strict=False):
        axis.set_title(_title(panel), loc="left")
        _DRAW[figure.kind](axis, panel, figure)
    for at, row in enumerate(rows):  # bars of a row are equally thick
        if figure.kind == "bars":
            for axis in axes[at * columns : at * columns + len(row)]:
                axis.set_ylim(max(1, *(len(panel.bars) for panel in row), 1) - 0.5, -0.5)
    _add_legend(sheet, axes[: len(panels)], [figure.quantity, *figure.legend, *figure.parts])
    foot = fill(figure.provenance, int(sheet.get_figwidth() * _CHARACTERS_PER_INCH * 1.25))
    sheet.supxlabel(foot, fontsize=SMALL, color=GREY)
    return sheet


def _height(figure: Figure, row: Sequence[Panel]) -> float:
    """Inches of a row of panels."""
    titles = _LINE_INCHES * max((_title(panel).count("\n") for panel in row), default=0)
    if figure.kind == "bars":
        bars = max((len(panel.bars) for panel in row), default=0)
        return 0.9 + titles + (_BAR_INCHES + _LINE_INCHES * _label_lines(figure)) * max(1, bars)
    if figure.kind == "pictures":
        shapes = [panel.picture.shape for panel in figure.panels if panel.picture is not None]
        return 0.3 + titles + (PANEL_INCHES - 0.2) * max((shape[0] / shape[1] for shape in shapes), default=0.5)
    if figure.kind == "cells":
        cells = max((len(panel.cells.rows) for panel in row if panel.cells is not None), default=1)
        return 0.9 + titles + _CELL_INCHES * max(1, cells)
    return 2.6 + titles


def _title(panel: Panel) -> str:
    """The title and, below it, whose stand-in the scene is."""
    return "\n".join(filter(None, [_folded(panel.title), stand_in_note(panel.stands_for)]))


def _folded(text: str, width: int = _TITLE_CHARACTERS) -> str:
    """A title or label in lines that end behind commas where they can."""
    parts = [part if len(part) > width // 2 else part.replace(" ", "\xa0") for part in text.split(", ")]
    return fill(", ".join(parts), width, break_on_hyphens=False).replace("\xa0", " ")


def _label_lines(figure: Figure) -> int:
    """Lines of the longest label of a bar."""
    labels = [_folded(bar.label, _BAR_CHARACTERS) for panel in figure.panels for bar in panel.bars]
    return max((label.count("\n") + 1 for label in labels), default=1)


def _add_legend(sheet: mpl.Figure, axes: Sequence[Axes], order: Sequence[str]) -> None:
    """One legend above all panels, of the labels that occur, in this order."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    labels = [label for label in dict.fromkeys(order) if label in handles]
    if not labels:
        return
    width = sheet.get_figwidth() * _CHARACTERS_PER_INCH
    most_columns = max(1, int(width / (max(map(len, labels)) + 6)))
    rows = -(-len(labels) // most_columns)
    shown, columns = [handles[label] for label in labels], -(-len(labels) // rows)
    folded = [fill(label, int(width) - 8) for label in labels]
    sheet.legend(shown, folded, loc="outside upper center", ncols=columns, frameon=False, fontsize=SMALL)
    more = max(label.count("\n") for label in folded)
    sheet.set_figheight(sheet.get_figheight() + 0.2 * (rows + more))


def _draw_lines(axis: Axes, panel: Panel, figure: Figure) -> None:
    x_axis, y_axis = panel.x or figure.x, panel.y or figure.y
    assert x_axis is not None
    assert y_axis is not None
    shows = np.isfinite if y_axis.scale == "linear" else drawable
    ordinates = [_draw_line(axis, line, np.flatnonzero(shows(line.y))) for line in panel.lines]
    for level in panel.levels:
        _draw_level(axis, level)
    for mark in panel.marks:
        axis.plot([mark.x], [mark.y], label=mark.label or "_mark", zorder=5, **{"linestyle": "none"} | dict(mark.style))
    _draw_crosses(axis, panel)
    abscissae = [line.x[shows(line.y)] for line in panel.lines] + [
        np.array(cross.splits, float) for cross in panel.crosses
    ]
    marks = np.array([mark.y for mark in panel.marks], float)
    levels = [np.array([level.value, level.low, level.high]) for level in panel.levels]
    scale_axis(axis, "x", x_axis, np.concatenate([*abscissae, []]))
    scale_axis(axis, "y", y_axis, np.concatenate([*ordinates, marks, *levels]))
    tidy_axes(axis, "both", ("left", "bottom"))
    if panel.is_empty:
        axis.set_yticks([])
        axis.text(0.5, 0.5, "nothing measured", transform=axis.transAxes, ha="center", va="center", color=GREY)


def _draw_line(axis: Axes, line: Line, shown: NDArray[np.intp]) -> Array:
    """shown: places of the values that its axes can show. Returns all ordinates that it needs."""
    if len(shown) == 0:
        return np.zeros(0)
    shown = shown[np.argsort(line.x[shown], kind="stable")]
    x, y = line.x[shown], line.y[shown]
    looks = {"linewidth": 1.1, "zorder": 2} if line.thin else {"zorder": 3}
    axis.plot(x, y, label=line.label, rasterized=len(x) > _MANY_POINTS, **looks | dict(line.style))
    if line.interval is None or not np.isfinite(line.interval).any():
        return y
    low, high = (end[shown] for end in line.interval)
    # One line broken by NaN, a third of an SVG with a path for each.
    bars_x, bars_y = (np.stack(ends, axis=1).ravel() for ends in ([x, x, x], [low, high, np.full(len(x), np.nan)]))
    axis.plot(bars_x, bars_y, "_-", linewidth=0.9, zorder=2.9, color=line.style["color"], label="_bars")
    return np.concatenate([y, low, high])


def _draw_level(axis: Axes, level: Level, upright: bool = False) -> None:
    band, line = (axis.axvspan, axis.axvline) if upright else (axis.axhspan, axis.axhline)
    line(level.value, label=level.label, zorder=2.5, **level.style)
    if np.isfinite(level.low) and np.isfinite(level.high):
        band(level.low, level.high, color=level.style["color"], alpha=0.15, linewidth=0, zorder=1)


def _draw_crosses(axis: Axes, panel: Panel) -> None:
    """On the upper edge, each series at its own height, so that one cross does not hide another."""
    series = list(dict.fromkeys(cross.series for cross in panel.crosses))
    for cross in panel.crosses:
        height = 0.985 - 0.05 * series.index(cross.series)
        axis.plot(
            cross.splits, [height] * len(cross.splits), "x", color=cross.color, markersize=5, markeredgewidth=1.4,
            transform=axis.get_xaxis_transform(), clip_on=False, zorder=5, label="_cross",
        )  # fmt: skip


def _draw_bars(axis: Axes, panel: Panel, figure: Figure) -> None:
    """Bars from zero, from the top down, each below its label, with whiskers over their intervals; levels upright."""
    assert figure.x is not None
    for place, bar in enumerate(panel.bars):
        _draw_bar(axis, place, bar, figure.parts, _label_lines(figure))
    for level in panel.levels:
        _draw_level(axis, level, upright=True)
    bars = [(bar.value, bar.high, sum(part for part in bar.parts if part > 0)) for bar in panel.bars]
    levels = [(level.value, level.low, level.high) for level in panel.levels]
    scale_axis(axis, "x", figure.x, np.array([*bars, *levels], float).ravel())
    axis.set_yticks([])
    tidy_axes(axis, "x", ("bottom",))


def _draw_bar(axis: Axes, place: int, bar: Bar, names: Sequence[str], lines: int) -> None:
    """Below its label. lines: of the longest label of its figure."""
    share = _LINE_INCHES * lines / (_BAR_INCHES + _LINE_INCHES * lines)  # of the height, for the label
    top, thick, end = place - 0.5 + share, 0.7 * (1 - share), 0.0
    middle = top + thick / 2
    for part, name, (color, hatch) in zip(bar.parts, names, PARTS, strict=False):
        if part > 0:
            axis.barh(
                middle, part, left=end, height=thick, color=color, hatch=hatch, edgecolor="white", linewidth=0.4,
                zorder=2, label=name,
            )  # fmt: skip
            end += part
    is_shown = np.isfinite(bar.value) and (bar.value > 0 or bar.series)
    if is_shown and not bar.parts:
        alpha, label = 0.5 if bar.faint else 1.0, bar.series or "_bar"
        axis.barh(middle, bar.value, height=thick, color=bar.color, alpha=alpha, zorder=2, label=label)
        axis.plot([bar.low, bar.high], [middle] * 2, color=BLACK, linewidth=1.1, zorder=3, label="_bars")
    axis.text(
        0, top, _folded(bar.label, _BAR_CHARACTERS), transform=axis.get_yaxis_transform(), va="bottom", zorder=4,
        color=BLACK if is_shown or bar.parts else GREY,
        bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _draw_cells(axis: Axes, panel: Panel, figure: Figure) -> None:
    """A grid whose colours are logarithmic."""
    cells = panel.cells
    assert cells is not None
    assert figure.x is not None
    assert figure.y is not None
    norm = LogNorm(cells.low, max(cells.high, cells.low * 1.01))
    axis.imshow(cells.values, origin="lower", cmap="cividis_r", norm=norm, aspect="auto")
    axis.plot([], [], "s", color="#7D7C78", label=figure.quantity)  # a tone of the map
    middle = np.sqrt(cells.low * cells.high)
    for (row, column), value in np.ndenumerate(cells.values):
        color = GREY if np.isnan(value) else "white" if value > middle else "black"
        axis.text(column, row, cells.texts[row][column], ha="center", va="center", color=color, linespacing=0.95)
    for frame in cells.frames:
        half = 0.4 if frame.inset else 0.46
        corner = (frame.column - half, frame.row - half)
        axis.add_patch(Rectangle(corner, 2 * half, 2 * half, fill=False, linewidth=2, label=frame.label, **frame.style))
    axis.set_xticks(range(len(cells.columns)), list(map(str, cells.columns)))
    axis.set_yticks(range(len(cells.rows)), list(map(str, cells.rows)))
    axis.set_xlabel(figure.x.label)
    axis.set_ylabel(figure.y.label)


def _draw_picture(axis: Axes, panel: Panel, figure: Figure) -> None:
    """The picture in a thin frame, or that there is none."""
    if panel.picture is None:
        axis.text(0.5, 0.5, "no picture", transform=axis.transAxes, ha="center", va="center", color=GREY)
        axis.set_box_aspect(1)
    else:
        axis.imshow(panel.picture)
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_edgecolor("#BBBBBB")


_DRAW = {"lines": _draw_lines, "bars": _draw_bars, "cells": _draw_cells, "pictures": _draw_picture}
