"""Horizontal bars with whiskers, or of parts, each below its label."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite

from matplotlib.axes import Axes

from experiments.drawing.axes import tidy_axis
from experiments.drawing.style import BLACK, GREY, PARTS, SMALL


@dataclass(frozen=True)
class Bar:
    """value, and the ends of its interval: in units of the axis, NaN where missing. text: stands beside the label."""

    label: str
    value: float
    low: float
    high: float
    color: str
    text: str
    faint: bool = False


def panel_height(bars: int) -> float:
    """Inches of a panel of so many bars."""
    return 1.3 + 0.42 * max(bars, 2)


def draw_bars(axis: Axes, bars: Sequence[Bar], quantity: str, draw_lines: Callable[[], float] = lambda: 0.0) -> None:
    """Horizontal bars from zero, from the top down, with whiskers over their intervals; one without a value is its
    text.

    quantity: along the abscissa. draw_lines: draws upright lines, and returns where the farthest of them ends.
    """
    for place, bar in enumerate(bars):
        shown = isfinite(bar.value) and bar.value > 0
        if shown:
            alpha = 0.5 if bar.faint else 1.0
            axis.barh(place + 0.2, bar.value, height=0.36, color=bar.color, alpha=alpha, zorder=2, label=bar.label)
            axis.plot([bar.low, bar.high], [place + 0.2] * 2, color=BLACK, linewidth=1.1, zorder=3, label="_bars")
        _write_bar(axis, place, bar.label, bar.text, BLACK if shown else GREY)
    ends = [end for bar in bars for end in (bar.value, bar.high) if isfinite(end)]
    _finish(axis, len(bars), max([*ends, draw_lines()]), quantity)


def _finish(axis: Axes, bars: int, longest: float, quantity: str) -> None:
    axis.set_yticks([])
    axis.set_ylim(max(bars, 1) - 0.5, -0.5)
    axis.set_xlim(0, 1.04 * longest or 1)
    axis.set_xlabel(quantity)
    tidy_axis(axis, "x", frame=("bottom",))


def _write_bar(axis: Axes, place: int, label: str, text: str, color: str) -> None:
    """What stands above a bar, from either end."""
    for end, said in (("left", label), ("right", text)):
        axis.text(
            end == "right", place - 0.2, said, transform=axis.get_yaxis_transform(), ha=end, va="center",
            fontsize=SMALL, color=color, zorder=4,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )  # fmt: skip


@dataclass(frozen=True)
class Stack:
    """A bar of parts, one after the other in units of the axis, NaN where there is none. text: beside the label."""

    label: str
    parts: tuple[float, ...]
    text: str


def draw_stacks(axis: Axes, stacks: Sequence[Stack], names: Sequence[str], quantity: str) -> None:
    """Horizontal stacked bars from the top down, from zero; names: of their parts, for a legend."""
    longest = 0.0
    for place, stack in enumerate(stacks):
        end = 0.0
        for part, name, (color, hatch) in zip(stack.parts, names, PARTS, strict=False):
            if isfinite(part) and part > 0:
                axis.barh(
                    place + 0.2, part, left=end, height=0.36, color=color, hatch=hatch, edgecolor="white",
                    linewidth=0.4, zorder=2, label=name,
                )  # fmt: skip
                end += part
        longest = max(longest, end)
        _write_bar(axis, place, stack.label, stack.text, BLACK)
    _finish(axis, len(stacks), longest, quantity)
