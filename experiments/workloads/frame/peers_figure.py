"""Our methods beside other people's ray tracers: millions of rays a second, the fastest first."""

from __future__ import annotations

from math import isfinite

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.values import numbers, say_number
from experiments.methods.naming import best_of
from experiments.workloads.panels import figure_of, make_panels, read_panels
from experiments.workloads.series import BestPoint, best_points, best_rows, say_ratio, say_unmeasured, say_wrong


def peers_figure(rows: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); Mray/s from zero.

    A bar is a method or a peer, ours at the best split; its whisker is the interval. What was not measured is listed
    below all panels with its reason.
    """
    panels = [panel for panel in make_panels(rows, (*best_of(), "packet_width")) if len(best_rows(panel.rows))]
    return figure_of(
        "bars", read_panels(panels, _bars), rows, *_say_missing(rows), x=Axis("million rays a second", "linear"),
        headings=("", "the rate, packets / this and its interval"),
    )  # fmt: skip


def rays_per_s(rows: pd.DataFrame, name: str = "render_time_s") -> NDArray[np.float64]:
    """(N,) float64 Mray/s: pixels over the time in the column, NaN where missing."""
    pixels = numbers(rows, "width") * numbers(rows, "height")
    with np.errstate(divide="ignore"):
        return pixels / numbers(rows, name) / 1e6


def _bars(rows: pd.DataFrame) -> Panel:
    points = list(best_points(rows))
    bars = [_bar(point) for point in points if len(point.best)]
    ordered = sorted(bars, key=lambda bar: bar.value if isfinite(bar.value) else 0.0, reverse=True)
    return Panel(bars=ordered, notes=[line for point in points for line in say_wrong(point.best, point.name)])


def _bar(point: BestPoint) -> Bar:
    ends = ("", "_high", "_low")  # the longer time is the lower rate
    value, low, high = (float(rays_per_s(point.best, f"render_time{end}_s")[0]) for end in ends)
    text = f"{say_number(value)}, {say_ratio(point.best.iloc[0])}"
    return Bar(point.label, value, low, high, point.color, text, faint=point.is_single)


def _say_missing(rows: pd.DataFrame) -> list[str]:
    """Lines on what was not measured; a reason that holds for every scene is said once, without their names."""
    scenes: dict[str, list[str]] = {}
    for scene in rows["scene"].unique():
        for point in best_points(rows[rows["scene"] == scene]):
            for line in say_unmeasured(point.points, point.name, whole=True):
                scenes.setdefault(line, []).append(str(scene))
    every = rows["scene"].nunique()
    return [line if len(names) == every else f"{line} ({', '.join(names)})" for line, names in scenes.items()]
