"""Figure -> PNG and SVG: lines over an axis, bars, a grid of cells, pictures."""

from __future__ import annotations

import io
from collections.abc import Sequence
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib import dates
from matplotlib import figure as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from experiments.drawing.figure import Array, Axis, Bar, Figure, Level, Line, NamedFigure, Panel, stand_in_note
from experiments.drawing.style import BLACK, DOTTED, GREY, PANEL_INCHES, PARTS, SMALL
from experiments.drawing.values import drawable

# A fixed salt and no date keep the SVG of equal tables equal.
_STYLE = {
    "font.size": SMALL, "axes.titlesize": SMALL, "axes.labelsize": SMALL, "axes.linewidth": 0.6,
    "lines.linewidth": 1.4, "lines.markersize": 4.0, "svg.hashsalt": "atra", "svg.fonttype": "path",
}  # fmt: skip
_CHARACTERS_PER_INCH = 11.0
"""Characters of small text that fit an inch."""
_MOST_TICKS = 8
"""More ticks of counts than this are labelled at every other one."""
_MANY_POINTS = 500
"""A line of more points is kept as dots in an SVG."""
_BAR_INCHES = 0.4


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
    columns = max(1, min(figure.columns, len(panels)))
    rows = max(1, -(-len(panels) // columns))
    sheet = mpl.Figure(figsize=(PANEL_INCHES * columns, rows * _height(figure) + 0.8), layout="constrained")
    FigureCanvasAgg(sheet)
    axes = list(sheet.subplots(rows, columns, squeeze=False).ravel())
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    for axis, panel in zip(axes, panels, strict=False):
        _set_title(axis, panel)
        _DRAW[figure.kind](axis, panel, figure)
    _add_legend(sheet, axes[: len(panels)], [figure.quantity, *figure.legend, *figure.parts])
    foot = fill(figure.provenance, int(sheet.get_figwidth() * _CHARACTERS_PER_INCH * 1.15))
    sheet.supxlabel(foot, fontsize=SMALL, color=GREY)
    return sheet


def _height(figure: Figure) -> float:
    """Inches of a panel."""
    if figure.kind == "bars":
        return 1.0 + _BAR_INCHES * max(2, *(len(panel.bars) for panel in figure.panels), 2)
    if figure.kind == "pictures":
        shapes = [panel.picture.shape for panel in figure.panels if panel.picture is not None]
        return 0.5 + (PANEL_INCHES - 0.2) * max((shape[0] / shape[1] for shape in shapes), default=0.5)
    return 3.1 if figure.kind == "cells" else 2.8


def _set_title(axis: Axes, panel: Panel) -> None:
    """The title and, below it, whose stand-in the scene is."""
    lines = [fill(panel.title, int(PANEL_INCHES * _CHARACTERS_PER_INCH)), stand_in_note(panel.stands_for)]
    axis.set_title("\n".join(filter(None, lines)), loc="left")


def _add_legend(sheet: mpl.Figure, axes: Sequence[Axes], order: Sequence[str]) -> None:
    """One legend above all panels, of the labels that occur, in this order."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    labels = [label for label in dict.fromkeys(order) if label in handles]
    if not labels:
        return
    width = sheet.get_figwidth() * _CHARACTERS_PER_INCH
    room = width / (max(map(len, labels)) + 6)
    rows = -(-len(labels) // max(1, int(room)))
    shown, columns = [handles[label] for label in labels], -(-len(labels) // rows)
    folded = [fill(label, int(width) - 8) for label in labels]
    sheet.legend(shown, folded, loc="outside upper center", ncols=columns, frameon=False, fontsize=SMALL)
    sheet.set_figheight(sheet.get_figheight() + 0.2 * rows)


def _draw_lines(axis: Axes, panel: Panel, figure: Figure) -> None:
    x_axis, y_axis = panel.x or figure.x, panel.y or figure.y
    assert x_axis is not None
    assert y_axis is not None
    shows = np.isfinite if y_axis.scale == "linear" else drawable
    ordinates = [_draw_line(axis, line, np.flatnonzero(shows(line.y))) for line in panel.lines]
    for level in panel.levels:
        _draw_level(axis, level)
    for mark in panel.marks:
        if mark.drop:
            axis.plot([mark.x] * 2, [1e-9, mark.y], color=mark.style["color"], linewidth=1, linestyle=DOTTED)
        axis.plot([mark.x], [mark.y], label=mark.label or "_mark", zorder=5, **{"linestyle": "none"} | dict(mark.style))
    _draw_crosses(axis, panel)
    abscissae = [line.x[shows(line.y)] for line in panel.lines] + [
        np.array(cross.splits, float) for cross in panel.crosses
    ]
    marks = np.array([mark.y for mark in panel.marks], float)
    levels = [np.array([level.value, level.low, level.high]) for level in panel.levels]
    _scale(axis, "x", x_axis, np.concatenate([*abscissae, []]))
    _scale(axis, "y", y_axis, np.concatenate([*ordinates, marks, *levels]))
    _tidy(axis, "both", ("left", "bottom"))
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
    if line.interval is None:
        return y
    low, high = (end[shown] for end in line.interval)
    # One line broken by NaN, a third of an SVG with a path for each; caps as wide on every place of a log axis.
    gap, left, right = np.full(len(x), np.nan), x / 1.06, x * 1.06
    bars_x = np.stack([x, x, gap, left, right, gap, left, right, gap], axis=1).ravel()
    bars_y = np.stack([low, high, gap, low, low, gap, high, high, gap], axis=1).ravel()
    axis.plot(bars_x, bars_y, linewidth=0.9, zorder=2.9, color=line.style["color"], label="_bars")
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


def _scale(axis: Axes, which: str, wanted: Axis, values: Array) -> None:
    """Scale, limits, ticks and label of one axis, by all values that it shows."""
    drawn = axis.xaxis if which == "x" else axis.yaxis
    drawn.set_label_text(wanted.label)
    set_scale, set_limits = getattr(axis, f"set_{which}scale"), getattr(axis, f"set_{which}lim")
    if wanted.scale == "days":
        places = dates.AutoDateLocator(minticks=2, maxticks=5)
        drawn.set_major_locator(places)
        drawn.set_major_formatter(dates.ConciseDateFormatter(places))
        return
    known = values[drawable(values)]
    if wanted.scale == "linear":
        set_limits(0 if wanted.low is None else wanted.low, 1.06 * max(known, default=1.0))
        return
    if wanted.scale == "counts":
        highest = max(1, *known, 1)
        set_scale("symlog", linthresh=1, linscale=0.4)
        ticks = [0.0, *(10.0**power for power in range(len(f"{highest:.0f}") + 1) if 10**power <= 10 * highest)]
        set_limits(0, 1.2 * highest)
    else:
        set_scale("log")
        low, high = (min(known), max(known)) if len(known) else (1.0, 2.0)
        if high < 1.5 * low:  # a single value has no range of its own
            low, high = low / 1.5, high * 1.5
        low = low / 1.25 if wanted.low is None else wanted.low
        set_limits(low, high * 1.25)
        ticks = sorted(set(known)) if wanted.scale == "ticks" else _ticks(low, high * 1.25)
    rare = 2 if len(ticks) > _MOST_TICKS else 1
    drawn.set_ticks(ticks, [wanted.say(tick) if place % rare == 0 else "" for place, tick in enumerate(ticks)])
    drawn.set_ticks([], minor=True)


def _ticks(low: float, high: float) -> list[float]:
    """The coarsest round values, at least three of them if possible, from `low` to `high`."""
    ticks: list[float] = []
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(step / 10 for step in range(10, 100, 5))):
        ticks = [step * 10.0**power for power in range(-4, 9) for step in steps]
        ticks = sorted({tick for tick in ticks if low <= tick <= high})
        if len(ticks) >= 3:
            break
    return ticks


def _draw_bars(axis: Axes, panel: Panel, figure: Figure) -> None:
    """Bars from zero, from the top down, each below its label, with whiskers over their intervals; levels upright."""
    assert figure.x is not None
    for place, bar in enumerate(panel.bars):
        _draw_bar(axis, place, bar, figure.parts)
    for level in panel.levels:
        _draw_level(axis, level, upright=True)
    bars = [(bar.value, bar.high, sum(part for part in bar.parts if part > 0)) for bar in panel.bars]
    levels = [(level.value, level.low, level.high) for level in panel.levels]
    _scale(axis, "x", figure.x, np.array([*bars, *levels], float).ravel())
    axis.set_yticks([])
    axis.set_ylim(max(len(panel.bars), 1) - 0.5, -0.5)
    _tidy(axis, "x", ("bottom",))


def _draw_bar(axis: Axes, place: int, bar: Bar, names: Sequence[str]) -> None:
    middle, end = place + 0.2, 0.0
    for part, name, (color, hatch) in zip(bar.parts, names, PARTS, strict=False):
        if part > 0:
            axis.barh(
                middle, part, left=end, height=0.36, color=color, hatch=hatch, edgecolor="white", linewidth=0.4,
                zorder=2, label=name,
            )  # fmt: skip
            end += part
    is_shown = np.isfinite(bar.value) and (bar.value > 0 or bar.series)
    if is_shown and not bar.parts:
        alpha, label = 0.5 if bar.faint else 1.0, bar.series or "_bar"
        axis.barh(middle, bar.value, height=0.36, color=bar.color, alpha=alpha, zorder=2, label=label)
        axis.plot([bar.low, bar.high], [middle] * 2, color=BLACK, linewidth=1.1, zorder=3, label="_bars")
    axis.text(
        0, place - 0.2, bar.label, transform=axis.get_yaxis_transform(), va="center", zorder=4,
        color=BLACK if is_shown or bar.parts else GREY,
        bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _draw_cells(axis: Axes, panel: Panel, figure: Figure) -> None:
    """A grid whose colours are logarithmic."""
    cells = panel.cells
    assert cells is not None
    assert figure.x is not None
    assert figure.y is not None
    norm = LogNorm(cells.low, max(cells.high, cells.low * 1.01))
    axis.imshow(cells.values, origin="lower", cmap="cividis_r", norm=norm)
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
    for mark in panel.marks:
        axis.plot([], [], label=mark.label, **{"linestyle": "none"} | dict(mark.style))
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_edgecolor("#BBBBBB")


def _tidy(axis: Axes, lines: Any, frame: Sequence[str]) -> None:
    """A light grid of these lines behind all that is drawn, and no frame but on these sides."""
    axis.grid(True, axis=lines, color="#DDDDDD", linewidth=0.6)
    axis.set_axisbelow(True)
    for side, spine in axis.spines.items():
        spine.set_visible(side in frame)


_DRAW = {"lines": _draw_lines, "bars": _draw_bars, "cells": _draw_cells, "pictures": _draw_picture}
