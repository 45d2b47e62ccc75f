"""Horizontal bars with whiskers, and labels that must not overlap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from experiments.drawing.axes import draw_baseline, tidy_axis
from experiments.drawing.style import BLACK, GREY
from experiments.drawing.values import numbers


@dataclass(frozen=True)
class Bar:
    """value, low (lower quartile), high (upper): in units of the axis, NaN where missing. text: stands behind it."""

    label: str
    value: float
    low: float
    high: float
    color: str
    text: str
    faint: bool = False


def draw_bars(axis: Axes, bars: Sequence[Bar]) -> None:
    """Horizontal bars from the top down with whiskers from quartile to quartile; one without a value is its text."""
    for place, bar in enumerate(bars):
        shown = isfinite(bar.value) and bar.value > 0
        if shown:
            alpha = 0.5 if bar.faint else 1.0
            axis.barh(place, bar.value, height=0.62, color=bar.color, alpha=alpha, zorder=2, label=bar.label)
            axis.plot([bar.low, bar.high], [place, place], color=BLACK, linewidth=1.1, zorder=3, label="_bars")
        end = float(np.nanmax([bar.value, bar.high])) if shown else 0.0
        axis.annotate(
            bar.text, (end, place), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8.5,
            color=BLACK if shown else GREY, zorder=4,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )  # fmt: skip
    axis.set_yticks(range(len(bars)), [bar.label for bar in bars])
    axis.tick_params(axis="y", length=0)
    axis.set_ylim(len(bars) - 0.45, -0.55)


def finish_bar_axes(axis: Axes, bars: Sequence[Bar], quantity: str, furthest: float = 0.0) -> None:
    """Abscissa from zero with room for the text behind the longest bar and for a line at `furthest`."""
    ends = [end for bar in bars for end in (bar.value, bar.high) if isfinite(end)]
    axis.set_xlim(0, max([1.95 * end for end in ends] + [1.04 * furthest]) or 1)
    axis.set_xlabel(quantity)
    tidy_axis(axis, "x", frame=("bottom",))


def draw_upright_lines(
    axis: Axes, rows: pd.DataFrame, lines: Mapping[str, tuple[str, dict[str, Any]]], factor: float
) -> float:
    """Upright baselines: the median of a column over all rows, with a band from quartile to quartile.

    lines: label -> column and line. factor: seconds -> the units of the axis. Returns where the last one stands, 0
    without any.
    """
    ends = [draw_baseline(axis, numbers(rows, name) * factor, style, label, upright=True)
            for label, (name, style) in lines.items()]  # fmt: skip
    return max(ends, default=0.0)


def spread(values: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """The values moved apart until none are closer than `gap`, for labels that must not overlap; order is kept.

    values: (N,). Values that crowd each other are laid out evenly around their mean; the others stay.
    """
    order = np.argsort(values, kind="stable")
    crowds: list[list[float]] = []
    for value in values[order]:
        crowds.append([float(value)])
        while len(crowds) > 1 and _places(crowds[-1], gap)[0] - _places(crowds[-2], gap)[-1] < gap:
            crowds[-2:] = [crowds[-2] + crowds[-1]]
    result = np.empty(len(values))
    result[order] = [place for crowd in crowds for place in _places(crowd, gap)]
    return result


def _places(crowd: Sequence[float], gap: float) -> NDArray[np.float64]:
    return np.mean(crowd) + gap * (np.arange(len(crowd)) - (len(crowd) - 1) / 2)
