"""Axes of a panel: their scales, limits, ticks and labels."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import dates
from matplotlib.axes import Axes

from experiments.drawing.figure import Array, Axis
from experiments.drawing.values import drawable

_LABEL_CHARACTERS = 30
"""Longest line of the label of an upright axis."""
_TICK_SPACE = {"x": 0.12, "y": 0.06}
"""Least distance of two labelled ticks, as a share of the axis."""


def scale_axis(axis: Axes, which: str, wanted: Axis, values: Array) -> None:
    """Scale, limits, ticks and label of one axis, by all values that it shows."""
    drawn = axis.xaxis if which == "x" else axis.yaxis
    drawn.set_label_text(wanted.label if which == "x" else fill(wanted.label, _LABEL_CHARACTERS))
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
        highest, scale = max(1, *known, 1), {"value": "symlog", "linthresh": 1, "linscale": 0.4}
        ticks = [0.0, *(10.0**power for power in range(len(f"{highest:.0f}") + 1) if 10**power <= 10 * highest)]
        ends = 0.0, 1.2 * highest
    else:
        scale = {"value": "log"}
        low, high = (min(known), max(known)) if len(known) else (1.0, 2.0)
        if high < 1.5 * low:  # a single value has no range of its own
            low, high = low / 1.5, high * 1.5
        low = low / 1.25 if wanted.low is None else wanted.low
        ends = low, high * 1.25
        ticks = sorted(set(known)) if wanted.scale == "ticks" else _ticks(*ends)
    set_limits(*ends)  # before the scale, which would look for limits of its own
    set_scale(**scale)
    labelled = _labelled(drawn, ticks, ends, _TICK_SPACE[which])
    drawn.set_ticks(ticks, [wanted.say(tick) if tick in labelled else "" for tick in ticks])
    drawn.set_ticks([], minor=True)


def _labelled(axis: Any, ticks: Sequence[float], ends: tuple[float, float], space: float) -> list[float]:
    """The last tick and, from there back, those that are not closer than `space` to the labelled one behind them."""
    low, high, *places = axis.get_transform().transform([*ends, *ticks])
    labelled: list[float] = []
    behind = np.inf
    for tick, place in sorted(zip(ticks, places, strict=True), reverse=True):
        if behind - place >= space * abs(high - low):
            labelled.append(tick)
            behind = place
    return labelled


def _ticks(low: float, high: float) -> list[float]:
    """The coarsest round values, at least three of them if possible, from `low` to `high`."""
    ticks: list[float] = []
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(step / 10 for step in range(10, 100, 5))):
        ticks = [step * 10.0**power for power in range(-4, 9) for step in steps]
        ticks = sorted({tick for tick in ticks if low <= tick <= high})
        if len(ticks) >= 3:
            break
    return ticks


def tidy_axes(axis: Axes, lines: Any, frame: Sequence[str]) -> None:
    """A light grid of these lines behind all that is drawn, and no frame but on these sides."""
    axis.grid(True, axis=lines, color="#DDDDDD", linewidth=0.6)
    axis.set_axisbelow(True)
    for side, spine in axis.spines.items():
        spine.set_visible(side in frame)
