"""Figure 4 of the paper: maps of time, and of speed-up, over both axes' splits, with culling off and on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Cells, Figure, Frame, Panel
from experiments.drawing.missing import missing_points
from experiments.drawing.style import DASHED, GREY, PURPLE, TIMES, VERMILLION
from experiments.drawing.values import MILLISECONDS, drawable, numbers, only_measured, say_number
from experiments.methods.naming import COPIED_OFF, FORM_OPTIONS, aligned_forms, aligned_rows, expected_forms
from experiments.workloads.frame_figures import ALL_HITS, all_hits, say_level
from experiments.workloads.panels import PanelRows, figure_of, make_panels
from experiments.workloads.series import beside, best_points, best_rows, own_ratio, say_baseline, say_wrong

_BEST = "best split, by the ratio in the same rounds"
_ABSENT = "\N{EN DASH}"
_AXES = ("split_x", "split_y")

Values = NDArray[np.float64]
Read = Callable[[pd.DataFrame], tuple[Callable[[pd.DataFrame], Values], Callable[[float], str], list[str]]]
"""The rows of a panel -> what reads the values of rows, what says a value in its cell, and notes."""


def grid_times(table: pd.DataFrame) -> Figure:
    """Two maps a scene (and a value of any other setting that varies), culling off and on, of milliseconds a frame.

    Framed are the best split, and the one that splits and culls nothing. The legend says why cells have no time. Both
    maps of a scene share their colours, which are logarithmic.
    """

    def times_ms(rows: pd.DataFrame) -> Values:
        return numbers(rows, "render_time_s") * MILLISECONDS

    return _figure(table, lambda rows: (times_ms, say_number, _say_beside(rows, table)), "milliseconds of a frame")


def grid_ratios(table: pd.DataFrame) -> Figure:
    """The same in speed-ups under both readings of the paper's 1 x 1: over rays of the same kind (single rays or
    packets), and below over all hits, which is 1 x 1 without culling."""

    def read(rows: pd.DataFrame) -> tuple[Callable[[pd.DataFrame], Values], Callable[[float], str], list[str]]:
        ratio, start = own_ratio(rows), next(iter(all_hits(rows)), np.nan)
        notes = [] if np.isfinite(start) else [f"{ALL_HITS}: not measured, so no speed-up over it"]
        say = partial(_say_ratios, start)
        return partial(numbers, name=ratio), say, [*notes, *_say_beside(rows, table, ratio)]

    over = say_baseline(own_ratio(aligned_rows(table)))
    return _figure(table, read, f"speed-up over {over}; below, over all hits")


def _say_beside(rows: pd.DataFrame, table: pd.DataFrame, ratio: str | None = None) -> list[str]:
    """A line for each method of a file, which has no splits and no cell."""
    points = list(best_points(beside(rows, table)))
    told = [f"{point.name}: {say_level(best, ratio)}" for point in points for _, best in point.best.iterrows()]
    return [*told, *(line for point in points for line in say_wrong(point.best, point.name))]


def _say_ratios(start: float, ratio: float) -> str:
    """Over the nearest hit, and over all hits where that was measured."""
    over = f"\n{ratio / start:.2f}" if np.isfinite(start) else ""
    return f"{ratio:.2f}{over}"


def _figure(table: pd.DataFrame, read: Read, cells: str) -> Figure:
    """It says why cells are empty."""
    aligned = aligned_rows(table)
    panels = [shown for panel in make_panels(aligned, (*_AXES, *FORM_OPTIONS)) for shown in _maps(panel, read)]
    reasons = {reason.reason for reason in missing_points(aligned, "split_x", "", GREY)}
    has_absent = any(_ABSENT in row for panel in panels if panel.cells for row in panel.cells.texts)
    why = [f"{TIMES}: {' or '.join(sorted(reasons))}"] if reasons else []
    why += [f"{_ABSENT}: not in the table"] if has_absent else []
    return figure_of(
        "cells", panels, table, legend=[_BEST, ALL_HITS], quantity="; ".join([f"in each cell: {cells}", *why]),
        x=Axis("horizontal splits"), y=Axis("vertical splits"),
    )  # fmt: skip


def _maps(panel: PanelRows, read: Read) -> Iterator[Panel]:
    """A map for each form of the geometry."""
    values_of, say, notes = read(panel.rows)
    shown = only_measured(panel.rows, values_of(panel.rows))
    shown = shown[drawable(shown)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (1.0, 1.0)
    splits_x, splits_y = (sorted(int(split) for split in panel.rows[name].dropna().unique()) for name in _AXES)
    forms = aligned_forms(panel.rows)
    for form in expected_forms(panel.rows):
        points = forms.get(form, panel.rows[:0])
        values = only_measured(points, values_of(points))
        # Rows are vertical splits, from below.
        colours = np.full((len(splits_y), len(splits_x)), np.nan)
        texts = np.full(colours.shape, _ABSENT, object)
        for (_, point), value in zip(points.iterrows(), values, strict=True):
            cell = splits_y.index(int(point["split_y"])), splits_x.index(int(point["split_x"]))
            if drawable(value):
                colours[cell], texts[cell] = value, say(value)
            else:
                texts[cell] = "no value" if point["status"] == "ok" else TIMES
        frames = [
            Frame(label, splits_x.index(point["split_x"]), splits_y.index(point["split_y"]), style, inset=inset)
            for point, label, style, inset in _framed(form, points, values)
        ]
        cells = Cells(splits_x, splits_y, colours, texts.tolist(), low, high, frames)
        yield panel.panel(Panel(cells=cells, notes=notes), f", {form.removeprefix('aligned, ')}")


def _framed(
    form: str, points: pd.DataFrame, values: Values
) -> Iterator[tuple[pd.Series, str, dict[str, object], bool]]:
    """The best split and, without culling, the one that splits nothing: its label, its line, and whether it lies inside
    of other frames."""
    if form == COPIED_OFF:
        start = points[points["split_x"].eq(1) & points["split_y"].eq(1) & drawable(values)]
        for _, point in start.iterrows():
            yield point, ALL_HITS, {"edgecolor": PURPLE, "linestyle": DASHED}, True
    if drawable(values).sum() > 1:  # a single one is no choice
        for _, best in best_rows(points).iterrows():
            yield best, _BEST, {"edgecolor": VERMILLION}, False
