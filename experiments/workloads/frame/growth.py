"""Growth: how time, preparation and bytes follow triangles or pixels, and where one method overtakes another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from experiments.drawing.axes import draw_series, label_axes, mark_place, say_nothing_measured, write_plainly
from experiments.drawing.pages import add_legend, make_figure, set_panel_title, write_foot, write_notes, write_table
from experiments.drawing.style import BLACK, DOTTED, GREY, TIMES
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, drawable, interval, numbers, say_number, varies
from experiments.methods import METHODS, find_method
from experiments.methods.naming import best_of, say_series
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads import panels
from experiments.workloads.frame.break_even import time_rows
from experiments.workloads.series import OVER_PACKETS, best_rows, say_unmeasured, say_wrong, series_of, style_of

_PIXELS = ("width", "height")
AXES = {"subdivided": ("subdivided",), "copies": ("copies",), "pixels": _PIXELS}
"""What grows -> the settings that change it."""

UNITS = {"subdivided": "triangles", "copies": "triangles", "pixels": "pixels"}

_TITLES = {"subdivided": "subdivided", "copies": "copies of it as one mesh", "pixels": "larger images"}

TOO_CLOSE = 0.02
"""Largest difference of logarithms at which two methods count as equally fast."""


@dataclass(frozen=True, eq=False)
class Growth:
    """A method and packet width at its best split; all arrays (N,), sizes ascending.

    over_packets: speed-up over packets in the same rounds. preparation_s: plan and build. bytes: what the method holds
    by its own account, NaN if unknown.
    """

    method: str
    packet_width: int | None
    sizes: NDArray[np.float64]
    time_s: NDArray[np.float64]
    low_s: NDArray[np.float64]
    high_s: NDArray[np.float64]
    over_packets: NDArray[np.float64]
    preparation_s: NDArray[np.float64]
    bytes: NDArray[np.float64]

    @property
    def name(self) -> str:
        return say_series(self.method, self.packet_width)


@dataclass(frozen=True, eq=False)
class Panel(panels.Panel):
    """Rows of one scene that differ in one of `AXES`. details: the settings that all of them share."""

    axis: str

    @property
    def title(self) -> str:
        return ", ".join(filter(None, [f"{self.scene}, {_TITLES[self.axis]}", self.details]))

    @property
    def unit(self) -> str:
        return UNITS[self.axis]


def growth_panels(table: pd.DataFrame) -> list[Panel]:
    """One a scene, an axis, and a value of every other setting that varies, where at least two sizes are."""
    rows = time_rows(table)
    found = []
    for scene in rows["scene"].unique():
        of_scene = rows[rows["scene"] == scene]
        for axis, names in AXES.items():
            # An enlarged mesh has another hash.
            besides = (*best_of(), "packet_width", *names, *(() if names == _PIXELS else ("mesh_sha256",)))
            others = settings_that_vary(of_scene, besides)
            groups = of_scene.groupby(others, sort=True, dropna=False) if others else [((), of_scene)]
            for key, some in groups:
                if any(varies(some, name) for name in names):
                    words = [say_setting(name, value) for name, value in zip(others, key, strict=True)]
                    found.append(Panel(str(scene), ", ".join(words), some, axis))
    return found


def growths(panel: Panel) -> Iterator[Growth]:
    """One a method and packet width that was measured in the panel."""
    for method, width, points in series_of(panel.rows):
        best = best_rows(points)
        sizes = numbers(best, "triangles")
        if panel.unit == "pixels":
            sizes = numbers(best, "width") * numbers(best, "height")
        order = np.argsort(sizes, kind="stable")
        best, sizes = best.iloc[order], sizes[order]
        if len(best):
            time_s, low_s, high_s = interval(best, "render_time{}_s")
            prepared_s = np.nan_to_num(numbers(best, "plan_time_s")) + numbers(best, "build_time_s")
            over = numbers(best, OVER_PACKETS)
            yield Growth(method, width, sizes, time_s, low_s, high_s, over, prepared_s, _bytes(best, method))


def _bytes(rows: pd.DataFrame, method: str) -> NDArray[np.float64]:
    names = ["embree_bytes", *(one.name for one in find_method(method).counters if one.name.endswith("_bytes"))]
    held = np.nansum([numbers(rows, name) for name in names], axis=0)
    return np.where(held > 0, held, np.nan)


def fitted_slope(sizes: NDArray[np.float64], values: NDArray[np.float64]) -> float | None:
    """k of the values' growth as size^k, by least squares of the logarithms; None with fewer than two sizes."""
    known = drawable(values)
    if len(np.unique(sizes[known])) < 2:
        return None
    return float(np.polyfit(np.log(sizes[known]), np.log(values[known]), 1)[0])


@dataclass(frozen=True)
class Crossing:
    """Where two growths cross. ahead: the method that is faster above `size`; behind: the one that is faster below."""

    size: float
    ahead: Growth
    behind: Growth


def crossings(one: Growth, other: Growth) -> list[Crossing]:
    """Where one overtakes the other, interpolated linearly in logarithms between sizes that both were measured at.

    Compares speed-ups over packets in the same rounds, which drift of the machine does not change.
    """
    sizes, ratio = advantage(one, other)
    sizes, ratio = sizes[(decided := np.abs(np.log(ratio)) > TOO_CLOSE)], ratio[decided]
    found = []
    for (low, before), (high, after) in pairwise(zip(np.log(sizes), np.log(ratio), strict=True)):
        if before * after < 0:
            size = float(np.exp(low + (high - low) * before / (before - after)))
            found.append(Crossing(size, *((one, other) if after > 0 else (other, one))))
    return found


def advantage(one: Growth, other: Growth) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sizes at which both were measured, and how many times as fast `one` is there; (N,) each."""
    sizes, own, others = np.intersect1d(one.sizes, other.sizes, return_indices=True)
    ratio = one.over_packets[own] / other.over_packets[others]
    return sizes[(known := drawable(ratio))], ratio[known]


def say_crossings(panel: Panel) -> Iterator[str]:
    """For every two methods: where one overtakes the other, or by how much it leads everywhere."""
    for one, other in combinations(growths(panel), 2):
        sizes, ratio = advantage(one, other)
        if len(sizes) == 0:
            continue
        found = crossings(one, other)
        for crossing in found:
            yield (
                f"{crossing.ahead.name} overtakes {crossing.behind.name} at about {say_count(crossing.size)} "
                f"{panel.unit}"
            )
        if found:
            continue
        leads = float(np.exp(np.log(ratio).mean())) >= 1
        ahead, behind = (one, other) if leads else (other, one)
        least, most = (ratio.min(), ratio.max()) if leads else (1 / ratio.max(), 1 / ratio.min())
        yield (
            f"{ahead.name} is {least:.2f} to {most:.2f}{TIMES} as fast as {behind.name} from {say_count(sizes[0])} to "
            f"{say_count(sizes[-1])} {panel.unit}"
        )


def growth_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Where one method overtakes another as something grows, for the terminal."""
    for panel in growth_panels(rows):
        yield from (f"{panel.title}: {line}" for line in say_crossings(panel))


def say_count(count: float) -> str:
    """ "17.8k", "1.05M"."""
    for unit, letter in ((1e6, "M"), (1e3, "k")):
        if count >= 0.9995 * unit:
            return f"{count / unit:.3g}{letter}"
    return f"{count:.3g}"


def growing_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows that some panel shows."""
    rows = time_rows(table)
    shown = {place for panel in growth_panels(rows) for place in panel.rows.index}
    return rows[[place in shown for place in rows.index]]


_HEADINGS = ("frame", "grows", "prepared", "grows", "MiB", "grows")
_PREPARATION = "its plan and build"

_ROOM = 20.0
"""How far the axis reaches below the shortest time, for numbers of crossings."""


def draw_growth_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene and a thing that grows; both axes logarithmic.

    A line is a method at its best split, dotted its plan and build. A ring marks where one overtakes another. Below
    each panel stand time, preparation and bytes at the largest size, and the fitted exponents of their growth.
    """
    panels = growth_panels(table)
    figure, axes = make_figure(len(panels), columns, 5.6)
    for axis, panel in zip(axes, panels, strict=True):
        set_panel_title(axis, panel.title, panel.stands_for)
        _draw_panel(axis, panel)
    widths = [None, 1, 4, 8, 16]
    names = dict.fromkeys(say_series(method.name, width) for method in METHODS for width in widths)
    add_legend(figure, axes, [*names, _PREPARATION])
    write_foot(
        figure, table, "dotted: plan and build; ring: one method overtakes another, by ratios within rounds",
        "below a panel, at the largest size: ms of a frame, ms of plan and build, MiB that the method holds by its own "
        "account; each followed by k of its growth as size to the power of k, fitted over all sizes",
    )  # fmt: skip
    return figure


def _draw_panel(axis: Axes, panel: Panel) -> None:
    axis.set_xscale("log")
    axis.set_yscale("log")
    drawn = list(growths(panel))
    entries = []
    for one in drawn:
        style = style_of(one.method, None if one.packet_width == 1 else one.packet_width)
        interval = (one.low_s * MILLISECONDS, one.high_s * MILLISECONDS)
        draw_series(axis, one.sizes, one.time_s * MILLISECONDS, style, interval, one.name)
        prepared = drawable(one.preparation_s)
        axis.plot(
            one.sizes[prepared], one.preparation_s[prepared] * MILLISECONDS, linewidth=1.2, linestyle=DOTTED, zorder=2,
            color=style["color"], label="_preparation",
        )  # fmt: skip
        entries.append((style["color"], one.name, _cells(one)))
    _draw_crossings(axis, drawn)
    axis.plot([], [], linewidth=1.2, linestyle=DOTTED, color=GREY, label=_PREPARATION)
    _finish(axis, panel, drawn)
    notes = list(say_crossings(panel))
    for method, width, points in series_of(panel.rows):
        name = say_series(method, width)
        notes += [*say_unmeasured(points, name), *say_wrong(points, name)]
    write_notes(axis, notes, write_table(axis, _HEADINGS, entries))


def _cells(one: Growth) -> list[str]:
    cells = []
    for values, unit in ((one.time_s, MILLISECONDS), (one.preparation_s, MILLISECONDS), (one.bytes, MEBIBYTES)):
        slope = fitted_slope(one.sizes, values)
        known = values[np.isfinite(values)]
        cells += [say_number(known[-1] * unit) if len(known) else "-", "-" if slope is None else f"k = {slope:.2f}"]
    return cells


def _draw_crossings(axis: Axes, drawn: list[Growth]) -> None:
    found = [(one, other, at.size) for one, other in combinations(drawn, 2) for at in crossings(one, other)]
    for place, (one, other, size) in enumerate(sorted(found, key=lambda crossing: crossing[2])):
        # Where the two lines pass, or nearly: they were measured hours apart.
        times = [np.interp(np.log(size), np.log(of.sizes), np.log(of.time_s)) for of in (one, other)]
        time_ms = float(np.exp(np.mean(times))) * MILLISECONDS
        mark_place(axis, (size, time_ms), say_count(size), place, BLACK)


def _finish(axis: Axes, panel: Panel, drawn: list[Growth]) -> None:
    sizes = np.unique(np.concatenate([one.sizes for one in drawn])) if drawn else np.array([1.0])
    axis.set_xticks(sizes, [say_count(size) for size in sizes])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.set_xlim(sizes[0] / 1.3, sizes[-1] * 1.3)
    least = [one.time_s[drawable(one.time_s)].min() for one in drawn if drawable(one.time_s).any()]
    if least:
        # Where nearly nothing is prepared, the table below says so.
        axis.set_ylim(bottom=min(least) * MILLISECONDS / _ROOM)
    write_plainly(axis.yaxis)
    label_axes(axis, panel.unit, "ms")
    if not drawn:
        say_nothing_measured(axis)
