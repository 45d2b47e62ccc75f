"""Axes over splits: lines with bars, baselines, ticks, grids."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from experiments.drawing.style import DOTTED, GREY, SMALL
from experiments.drawing.values import drawable

_SPLITS = {"split_x": "horizontal splits", "split_y": "vertical splits"}


def draw_series(
    axis: Axes, splits: NDArray[np.float64], values: NDArray[np.float64], style: dict[str, Any],
    interval: Sequence[NDArray[np.float64]] | None = None, label: str = "",
) -> None:  # fmt: skip
    """A line over splits with bars from end to end of an interval; what is missing is left out.

    splits, values and both ends: (N,) float64 in the units of the axis, in any order. Values that are not above
    zero have no place on a logarithmic axis and must not be handed in: see `drawable`.
    """
    shown = np.flatnonzero(drawable(values))
    if len(shown) == 0:
        return
    shown = shown[np.argsort(splits[shown], kind="stable")]
    axis.plot(splits[shown], values[shown], linewidth=1.6, markersize=5, zorder=3, label=label, **style)
    if interval is not None:
        low, high = (end[shown] for end in interval)
        axis.plot(*_bars(splits[shown], low, high), linewidth=1.1, zorder=2.9, color=style["color"], label="_bars")


def _bars(
    splits: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Abscissae and ordinates of bars with caps, one line broken by NaN: a third of an SVG with a path for each."""
    gap = np.full(len(splits), np.nan)
    # Caps as wide on every place of a logarithmic axis.
    left, right = splits / 1.06, splits * 1.06
    abscissae = np.stack([splits, splits, gap, left, right, gap, left, right, gap], axis=1)
    ordinates = np.stack([low, high, gap, low, low, gap, high, high, gap], axis=1)
    return abscissae.ravel(), ordinates.ravel()


def draw_baseline(
    axis: Axes, values: NDArray[np.float64], style: dict[str, Any], label: str = "", upright: bool = False
) -> float:
    """A line at the median of all points of something without splits, a band from quartile to quartile of the points.

    Returns the upper quartile, 0 where nothing was measured.
    """
    values = values[drawable(values)]
    if len(values) == 0:
        return 0.0
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    draw_band, draw_line = (axis.axvspan, axis.axvline) if upright else (axis.axhspan, axis.axhline)
    if q3 > q1:
        draw_band(q1, q3, color=style["color"], alpha=0.15, linewidth=0, zorder=1)
    draw_line(median, linewidth=1.5, zorder=2.5 if upright else 2, label=label, **style)
    return float(q3)


def draw_level(axis: Axes, ends: Sequence[float], color: str, label: str) -> None:
    """A level line at the value of something without splits, and a band over its interval.

    ends: the value and both ends of the interval, NaN where there is none.
    """
    value, low, high = ends
    axis.axhline(value, color=color, linewidth=1.5, zorder=2.5, label=label)
    if np.isfinite(low) and np.isfinite(high):
        axis.axhspan(low, high, color=color, alpha=0.15, linewidth=0, zorder=1)


def finish_split_axes(axis: Axes, splits: Iterable[int], axis_name: str, quantity: str) -> None:
    """Both axes logarithmic with readable ticks, labels and a light grid. To be called once everything is drawn."""
    axis.set_yscale("log")
    place_counts(axis, splits, 1.35)
    # The crosses of missing points hang on the edge and set no limits: without data these are infinite.
    if np.isfinite(axis.dataLim.intervaly).all() and axis.dataLim.intervaly[0] > 0:
        low, high = axis.get_ylim()
        # A single value has no range of its own.
        if high < 1.5 * low:
            low, high = low / 1.5, high * 1.5
        axis.set_ylim(low / 1.25, high * 1.1)
        axis.set_yticks(_ticks(*axis.get_ylim()))
    else:
        say_nothing_measured(axis)
    write_plainly(axis.yaxis)
    label_axes(axis, _SPLITS[axis_name], quantity)


def place_counts(axis: Axes, counts: Iterable[int], margin: float) -> list[int]:
    """A logarithmic abscissa with a tick for each count, wider by the factor `margin` at both ends; returns them."""
    ordered = sorted({int(count) for count in counts}) or [1]
    axis.set_xscale("log", base=2)
    axis.set_xticks(ordered, [str(count) for count in ordered])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.set_xlim(ordered[0] / margin, ordered[-1] * margin)
    return ordered


def mark_place(
    axis: Axes, at: tuple[float, float], text: str, place: int, color: str, to_the_left: bool = False
) -> None:
    """A ring, a dotted line down from it, and a text beside that line. place: number among several such texts, which
    may lie close together and so stand at different heights."""
    axis.plot([at[0]] * 2, [1e-9, at[1]], color=color, linewidth=1, linestyle=DOTTED, zorder=2, label="_line")
    axis.plot(
        [at[0]], [at[1]], "o", color=color, markerfacecolor="none", markersize=9, markeredgewidth=1.8, zorder=5,
        label="_ring",
    )  # fmt: skip
    axis.annotate(
        text, (at[0], 0.03 + 0.065 * place), xycoords=("data", "axes fraction"), xytext=(-3 if to_the_left else 3, 0),
        textcoords="offset points", ha="right" if to_the_left else "left", fontsize=SMALL, fontweight="bold",
        color=color, zorder=6,
    )  # fmt: skip


def tidy_axis(
    axis: Axes, lines: Literal["both", "x", "y"] = "both", frame: Collection[str] = ("left", "bottom")
) -> None:
    """A light grid of these lines behind all that is drawn, and no frame but on these sides."""
    axis.grid(True, axis=lines, color="#DDDDDD", linewidth=0.6)
    axis.set_axisbelow(True)
    for side, spine in axis.spines.items():
        spine.set_visible(side in frame)


def label_axes(axis: Axes, abscissa: str, ordinate: str) -> None:
    """Both quantities, and a light grid."""
    axis.set_xlabel(abscissa)
    axis.set_ylabel(ordinate)
    tidy_axis(axis)


def write_plainly(axis: Axis) -> None:
    """Numbers of a logarithmic axis without powers of ten."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))


def say_nothing_measured(axis: Axes) -> None:
    """In words, in the middle of a panel without data, which has no ordinates."""
    axis.set_yticks([])
    axis.text(0.5, 0.5, "nothing measured", transform=axis.transAxes, ha="center", va="center", color=GREY)


def _ticks(low: float, high: float) -> list[float]:
    """The coarsest round values, at least four of them if possible, from `low` to `high`."""
    ticks: list[float] = []
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(step / 10 for step in range(10, 100, 5))):
        ticks = [step * 10.0**power for power in range(-4, 9) for step in steps]
        ticks = sorted({tick for tick in ticks if low <= tick <= high})
        if len(ticks) >= 4:
            break
    return ticks
