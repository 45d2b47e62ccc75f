"""Figure 4 of the paper: maps of time, and of speed-up, over both axes' splits, with culling off and on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Cells, Figure, Frame, Panel
from experiments.drawing.missing import missing_points
from experiments.drawing.style import DASHED, GREY, PURPLE, TIMES, VERMILLION
from experiments.drawing.values import MILLISECONDS, drawable, numbers, only_measured, say_number, say_things
from experiments.methods.naming import COPIED_OFF, FORM_OPTIONS, aligned_forms, aligned_rows, expected_forms
from experiments.workloads.frame_figures import ALL_HITS, all_hits, say_level
from experiments.workloads.panels import PanelRows, figure_of, make_panels
from experiments.workloads.series import beside, best_points, best_rows, own_ratio, say_baseline

_BEST = "best split, by the ratio in the same rounds"
_ABSENT = "\N{EN DASH}"
_NO_POINTS = "not in the table"
_AXES = ("split_x", "split_y")

Values = NDArray[np.float64]


def grid_times(table: pd.DataFrame) -> Figure:
    """Two maps a scene (and a value of any other setting that varies), culling off and on, of milliseconds a frame.

    Framed are the best split, and the one that splits and culls nothing. The legend says why cells have no time. Both
    maps of a scene share their colours, which are logarithmic.
    """

    def read(rows: pd.DataFrame) -> Values:
        return numbers(rows, "render_time_s") * MILLISECONDS

    panels = []
    for panel in _panels(table):
        panels += _maps(panel, read, say_number, _say_beside(panel, table))
    return _figure(table, panels, "in each cell: milliseconds of a frame")


def grid_ratios(table: pd.DataFrame) -> Figure:
    """The same in speed-ups under both readings of the paper's 1 x 1: over rays of the same kind (single rays or
    packets), and below over all hits, which is 1 x 1 without culling."""
    panels, over = [], ""
    for panel in _panels(table):
        ratio, start = own_ratio(panel.rows), next(iter(all_hits(panel.rows)), np.nan)
        notes = [] if np.isfinite(start) else [f"{ALL_HITS}: not measured, so no speed-up over it"]
        notes += _say_beside(panel, table, ratio)
        panels += _maps(panel, partial(numbers, name=ratio), partial(_say_ratios, start), notes)
        over = say_baseline(ratio)
    return _figure(table, panels, f"in each cell: speed-up over {over}; below, over all hits")


def _say_beside(panel: PanelRows, table: pd.DataFrame, ratio: str | None = None) -> list[str]:
    """A line for each method of a file, which has no splits and no cell."""
    points = list(best_points(beside(panel.rows, table)))
    told = [f"{point.name}: {say_level(best, ratio)}" for point in points for _, best in point.best.iterrows()]
    return [*told, *(line for point in points for line in point.notes())]


def _say_ratios(start: float, ratio: float) -> str:
    """Over the nearest hit, and over all hits where that was measured."""
    over = f"\n{ratio / start:.2f}" if np.isfinite(start) else ""
    return f"{ratio:.2f}{over}"


def _panels(table: pd.DataFrame) -> list[PanelRows]:
    return make_panels(aligned_rows(table), (*_AXES, *FORM_OPTIONS))


def _figure(table: pd.DataFrame, panels: Sequence[Panel], cells: str) -> Figure:
    """It says why cells are empty, from the table."""
    reasons = {reason.reason for reason in missing_points(aligned_rows(table), "split_x", "", GREY)}
    has_absent = any(_ABSENT in row for panel in panels if panel.cells for row in panel.cells.texts)
    why = [f"{TIMES}: {' or '.join(sorted(reasons))}"] if reasons else []
    why += [f"{_ABSENT}: {_NO_POINTS}"] if has_absent else []
    return figure_of(
        "cells", panels, table, legend=[_BEST, ALL_HITS], quantity="; ".join([cells, *why]),
        x=Axis("horizontal splits"), y=Axis("vertical splits"),
    )  # fmt: skip


def _maps(
    panel: PanelRows, read: Callable[[pd.DataFrame], Values], say: Callable[[float], str], notes: Sequence[str]
) -> list[Panel]:
    """A map for each form of the geometry. read: rows -> their values. say: a value -> text of its cell."""
    shown = only_measured(panel.rows, read(panel.rows))
    shown = shown[drawable(shown)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (1.0, 1.0)
    splits_x, splits_y = (sorted(int(split) for split in panel.rows[name].dropna().unique()) for name in _AXES)
    forms, maps = aligned_forms(panel.rows), []
    for form in expected_forms(panel.rows):
        points, words = forms.get(form, panel.rows[:0]), form.removeprefix("aligned, ")
        values = only_measured(points, read(points))
        colours, texts = _cells(points, values, say, splits_x, splits_y)
        frames = [
            Frame(label, splits_x.index(point["split_x"]), splits_y.index(point["split_y"]), style, inset=inset)
            for point, label, style, inset in _framed(form, points, values)
        ]
        cells = Cells(splits_x, splits_y, colours, texts.tolist(), low, high, frames)
        why = _why_empty(points, values, words, int((texts == _ABSENT).sum()))
        maps.append(panel.panel(Panel(cells=cells, notes=[*why, *notes]), f", {words}"))
    return maps


def _cells(
    points: pd.DataFrame, values: Values, say: Callable[[float], str], splits_x: list[int], splits_y: list[int]
) -> tuple[Values, NDArray[np.object_]]:
    """Values, NaN where missing, and texts of all cells: rows are vertical splits, from below."""
    colours = np.full((len(splits_y), len(splits_x)), np.nan)
    texts = np.full(colours.shape, _ABSENT if len(points) else "", object)
    for (_, point), value in zip(points.iterrows(), values, strict=True):
        cell = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
        if drawable(value):
            colours[cell], texts[cell] = value, say(value)
        else:
            texts[cell] = "no value" if point["status"] == "ok" else TIMES
    return colours, texts


def _framed(form: str, points: pd.DataFrame, values: Values) -> list[tuple[pd.Series, str, dict[str, object], bool]]:
    """The best split and, without culling, the one that splits nothing: its label, its line, and whether it lies inside
    of other frames."""
    framed: list[tuple[pd.Series, str, dict[str, object], bool]] = []
    if form == COPIED_OFF:
        start = points[points["split_x"].eq(1) & points["split_y"].eq(1) & drawable(values)]
        looks: dict[str, object] = {"edgecolor": PURPLE, "linestyle": DASHED}
        framed += [(point, ALL_HITS, looks, True) for _, point in start.iterrows()]
    if drawable(values).sum() > 1:  # a single one is no choice
        framed += [(best, _BEST, {"edgecolor": VERMILLION}, False) for _, best in best_rows(points).iterrows()]
    return framed


def _why_empty(points: pd.DataFrame, values: Values, words: str, absent: int) -> list[str]:
    """Why cells have no value."""
    if len(points) == 0:
        return [f"{words}: {_NO_POINTS}"]
    notes = []
    for _, cells in points[points["status"] != "ok"].groupby("status", sort=False):
        reasons = missing_points(cells, "split_x", "", GREY)
        notes += [f"{TIMES} {say_things(len(cells), 'cell')}: {reason.reason}" for reason in reasons]
    without = int((points["status"].eq("ok").fillna(False).to_numpy(bool) & ~drawable(values)).sum())
    notes += [f"{say_things(without, 'cell')}: measured, but without this value"] if without else []
    return [*notes, *([f"{_ABSENT} {say_things(absent, 'cell')}: {_NO_POINTS}"] if absent else [])]
