"""Figure 4 of the paper: maps of time, and of speed-up, over both axes' splits, with culling off and on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from experiments.drawing.missing import missing_points
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes
from experiments.drawing.style import DASHED, GREY, PURPLE, SMALL, TIMES, VERMILLION
from experiments.drawing.values import MILLISECONDS, drawable, numbers, only_measured, say_number
from experiments.methods.naming import COPIED_OFF, FORM_OPTIONS, aligned_forms, aligned_rows, expected_forms
from experiments.workloads.frame_figures import ALL_HITS, all_hits, say_level
from experiments.workloads.panels import Panel, make_panels
from experiments.workloads.series import beside, best_points, best_rows, own_ratio, say_baseline

_BEST = "best split, by the ratio in the same rounds"
_ABSENT = "\N{EN DASH}"
_NO_POINTS = "not in the table"
_AXES = ("split_x", "split_y")


@dataclass(frozen=True)
class _Map:
    """The map of one form of the geometry in one panel.

    values: (N,) float64 of `points`, NaN where missing; they set the colours. say: a value -> text of its cell.
    quantity: in words, with its unit. low, high: ends of the colours, shared within a panel. notes: lines below.
    """

    form: str
    panel: Panel
    points: pd.DataFrame
    values: NDArray[np.float64]
    say: Callable[[float], str]
    quantity: str
    low: float
    high: float
    notes: Sequence[str]

    @property
    def words(self) -> str:
        """The form in words."""
        return self.form.removeprefix("aligned, ")


def draw_grid_times(table: pd.DataFrame, columns: int = 2) -> Figure:
    """Two maps a scene (and a value of any other setting that varies), culling off and on, of milliseconds a frame.

    Framed are the best split, and the one that splits and culls nothing. A cell without a time says why. Both maps of a
    scene share their colours.
    """

    def read(rows: pd.DataFrame) -> NDArray[np.float64]:
        return numbers(rows, "render_time_s") * MILLISECONDS

    maps = []
    for panel in _panels(table):
        maps += _maps(panel, read, say_number, "time of a frame in ms", _say_beside(panel, table))
    return _draw(table, columns, maps, "in each cell: milliseconds of a frame; colours are logarithmic")


def draw_grid_ratios(table: pd.DataFrame, columns: int = 2) -> Figure:
    """The same in speed-ups under both readings of the paper's 1 x 1: over rays of the same kind (single rays or
    packets), and below over all hits, which is 1 x 1 without culling."""
    maps = []
    for panel in _panels(table):
        ratio, start = own_ratio(panel.rows), next(iter(all_hits(panel.rows)), np.nan)
        notes = [] if np.isfinite(start) else [f"{ALL_HITS}: not measured, so no speed-up over it"]
        notes += _say_beside(panel, table, ratio)
        say = partial(_say_ratios, start)
        maps += _maps(panel, partial(numbers, name=ratio), say, f"speed-up over {say_baseline(ratio)}", notes)
    cells = f"in each cell: speed-up over the baseline that finds the nearest hit; below, over {ALL_HITS}"
    return _draw(table, columns, maps, cells)


def _say_beside(panel: Panel, table: pd.DataFrame, ratio: str | None = None) -> list[str]:
    """A line for each method of a file, which has no splits and no cell."""
    found = list(best_points(beside(panel.rows, table)))
    told = [f"{one.name}: {say_level(best, ratio)}" for one in found for _, best in one.best.iterrows()]
    return [*told, *(line for one in found for line in one.notes())]


def _say_ratios(start: float, ratio: float) -> str:
    """Over the nearest hit, and over all hits where that was measured."""
    over = f"\n{ratio / start:.2f}{TIMES}" if np.isfinite(start) else ""
    return f"{ratio:.2f}{TIMES}{over}"


def _panels(table: pd.DataFrame) -> list[Panel]:
    return make_panels(aligned_rows(table), (*_AXES, *FORM_OPTIONS))


def _maps(
    panel: Panel, read: Callable[[pd.DataFrame], NDArray[np.float64]], say: Callable[[float], str], quantity: str,
    notes: Sequence[str] = (),
) -> list[_Map]:  # fmt: skip
    """A map for each form of the geometry. read: rows -> their values."""
    values = only_measured(panel.rows, read(panel.rows))
    shown = values[drawable(values)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (1.0, 1.0)
    forms = aligned_forms(panel.rows)
    maps = []
    for form in expected_forms(panel.rows):
        points = forms.get(form, panel.rows[:0])
        maps.append(_Map(form, panel, points, only_measured(points, read(points)), say, quantity, low, high, notes))
    return maps


def _draw(table: pd.DataFrame, columns: int, maps: Sequence[_Map], foot: str) -> Figure:
    figure, axes = make_figure(len(maps), columns, panel_height=4.7)
    for axis, one in zip(axes, maps, strict=True):
        set_panel_title(axis, f"{one.panel.title}, {one.words}", one.panel.stands_for)
        _draw_map(axis, one)
    add_legend(figure, axes, [_BEST, ALL_HITS])
    write_foot(figure, table, foot)
    return figure


def _draw_map(axis: Axes, one: _Map) -> None:
    splits_x, splits_y = (sorted(int(split) for split in one.panel.rows[name].dropna().unique()) for name in _AXES)
    colours = np.full((len(splits_y), len(splits_x)), np.nan)
    texts = np.full(colours.shape, _ABSENT if len(one.points) else "", object)
    for (_, point), value in zip(one.points.iterrows(), one.values, strict=True):
        cell = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
        if drawable(value):
            colours[cell], texts[cell] = value, one.say(value)
        else:
            texts[cell] = "no value" if point["status"] == "ok" else str(point["status"])
    middle = np.sqrt(one.low * one.high)
    for (row, column), text in np.ndenumerate(texts):
        value = colours[row, column]
        color = GREY if np.isnan(value) else "white" if value > middle else "black"
        size = SMALL if "\n" in text or np.isnan(value) else 11
        axis.text(column, row, text, ha="center", va="center", fontsize=size, color=color)
    norm = LogNorm(one.low, max(one.high, one.low * 1.01))
    picture = axis.imshow(colours, origin="lower", cmap="cividis_r", norm=norm)
    _frame_cells(axis, one, splits_x, splits_y)
    if len(one.points) == 0:
        axis.text(0.5, 0.5, _NO_POINTS, transform=axis.transAxes, ha="center", va="center", color=GREY)
    axis.set_xticks(range(len(splits_x)), [str(split) for split in splits_x])
    axis.set_yticks(range(len(splits_y)), [str(split) for split in splits_y])
    axis.set_xlabel("horizontal splits")
    axis.set_ylabel("vertical splits")
    # One value alone has no scale.
    if one.high > one.low * 1.01:
        bar = axis.figure.colorbar(picture, ax=axis, shrink=0.7, label=one.quantity)
        ticks = np.geomspace(one.low, one.high, 4)
        bar.set_ticks(ticks.tolist(), labels=[say_number(tick) for tick in ticks])
        bar.minorticks_off()
    notes = [*_why_empty(one, int((texts == _ABSENT).sum())), *one.notes]
    write_notes(axis, notes, characters=44)


def _frame_cells(axis: Axes, one: _Map, splits_x: Sequence[int], splits_y: Sequence[int]) -> None:
    """Frames around the best split and, without culling, the one that splits nothing."""
    framed: list[tuple[pd.Series, str, float, dict[str, Any]]] = []
    if one.form == COPIED_OFF:
        start = one.points[one.points["split_x"].eq(1) & one.points["split_y"].eq(1) & drawable(one.values)]
        dashed = {"edgecolor": PURPLE, "linestyle": DASHED}
        framed += [(point, ALL_HITS, 0.4, dashed) for _, point in start.iterrows()]  # inside of the other frame
    if drawable(one.values).sum() > 1:  # a single one is no choice
        framed += [(best, _BEST, 0.46, {"edgecolor": VERMILLION}) for _, best in best_rows(one.points).iterrows()]
    for point, label, half, style in framed:
        corner = (splits_x.index(point["split_x"]) - half, splits_y.index(point["split_y"]) - half)
        axis.add_patch(Rectangle(corner, 2 * half, 2 * half, fill=False, linewidth=2.5, label=label, **style))


def _why_empty(one: _Map, absent: int) -> list[str]:
    """Why cells have no value."""
    if len(one.points) == 0:
        return [f"{one.words}: {_NO_POINTS}"]
    notes = []
    for _, cells in one.points[one.points["status"] != "ok"].groupby("status", sort=False):
        notes += [f"{_say_cells(len(cells))}: {reason.reason}" for reason in missing_points(cells, "split_x", "", GREY)]
    without = int((one.points["status"].eq("ok").fillna(False).to_numpy(bool) & ~drawable(one.values)).sum())
    notes += [f"{_say_cells(without)}: measured, but without this value"] if without else []
    return [*notes, *([f"{_ABSENT} {_say_cells(absent)}: not in the table"] if absent else [])]


def _say_cells(count: int) -> str:
    return f"{count} {'cell' if count == 1 else 'cells'}"
