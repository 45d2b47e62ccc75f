"""Growth: how time, preparation and bytes follow triangles or pixels, and where one method overtakes another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing import figure as drawing
from experiments.drawing.figure import Axis, Figure, Line, Mark
from experiments.drawing.style import BLACK, DOTTED, TIMES
from experiments.drawing.values import MEBIBYTES, MILLISECONDS, drawable, interval, numbers, say_number, varies
from experiments.methods import METHODS, find_method
from experiments.methods.naming import best_of, say_series
from experiments.results.settings import say_setting, settings_that_vary
from experiments.workloads import panels
from experiments.workloads.frame.break_even import time_rows
from experiments.workloads.frame_figures import ring
from experiments.workloads.series import OVER_PACKETS, best_rows, say_unmeasured, say_wrong, series_of, style_of

_PIXELS = ("width", "height")
AXES = {"subdivided": ("subdivided",), "copies": ("copies",), "pixels": _PIXELS}
"""What grows -> the settings that change it."""

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
class Panel(panels.PanelRows):
    """Rows of one scene that differ in one of `AXES`. details: the settings that all of them share."""

    axis: str

    @property
    def title(self) -> str:
        return ", ".join(filter(None, [f"{self.scene}, {_TITLES[self.axis]}", self.details]))

    @property
    def unit(self) -> str:
        return "pixels" if self.axis == "pixels" else "triangles"


def growth_panels(table: pd.DataFrame) -> list[Panel]:
    """One a scene, an axis, and a value of every other setting that varies, where at least two sizes are."""
    rows = time_rows(table)
    grown = []
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
                    grown.append(Panel(str(scene), ", ".join(words), some, axis))
    return grown


def growths(panel: Panel) -> Iterator[Growth]:
    """The growth of every method and packet width that was measured in the panel."""
    for method, width, points in series_of(panel.rows):
        best = best_rows(points)
        sizes = numbers(best, "triangles")
        if panel.unit == "pixels":
            sizes = numbers(best, "width") * numbers(best, "height")
        order = np.argsort(sizes, kind="stable")
        best, sizes = best.iloc[order], sizes[order]
        if len(best):
            prepared_s = np.nan_to_num(numbers(best, "plan_time_s")) + numbers(best, "build_time_s")
            time_s, low_s, high_s = interval(best, "render_time{}_s")
            over = numbers(best, OVER_PACKETS)
            yield Growth(method, width, sizes, time_s, low_s, high_s, over, prepared_s, _bytes(best, method))


def _bytes(rows: pd.DataFrame, method: str) -> NDArray[np.float64]:
    names = [
        "embree_bytes",
        *(name for counter in find_method(method).counters if (name := counter.name).endswith("_bytes")),
    ]
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


def crossings(first: Growth, second: Growth) -> list[Crossing]:
    """Where one overtakes the other, interpolated linearly in logarithms between sizes that both were measured at.

    Compares speed-ups over packets in the same rounds, which drift of the machine does not change.
    """
    sizes, ratio = advantage(first, second)
    sizes, ratio = sizes[(decided := np.abs(np.log(ratio)) > TOO_CLOSE)], ratio[decided]
    crossed = []
    for (low, before), (high, after) in pairwise(zip(np.log(sizes), np.log(ratio), strict=True)):
        if before * after < 0:
            size = float(np.exp(low + (high - low) * before / (before - after)))
            crossed.append(Crossing(size, *((first, second) if after > 0 else (second, first))))
    return crossed


def advantage(first: Growth, second: Growth) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sizes at which both were measured, and how many times as fast `first` is there; (N,) each."""
    sizes, own, others = np.intersect1d(first.sizes, second.sizes, return_indices=True)
    ratio = first.over_packets[own] / second.over_packets[others]
    return sizes[(known := drawable(ratio))], ratio[known]


def say_crossings(panel: Panel) -> Iterator[str]:
    """For every two methods: where one overtakes the other, or by how much it leads everywhere."""
    for first, second in combinations(growths(panel), 2):
        sizes, ratio = advantage(first, second)
        if len(sizes) == 0:
            continue
        crossed = crossings(first, second)
        for crossing in crossed:
            size = f"{say_count(crossing.size)} {panel.unit}"
            yield f"{crossing.ahead.name} overtakes {crossing.behind.name} at about {size}"
        if not crossed:
            leads = float(np.exp(np.log(ratio).mean())) >= 1
            ahead, behind = (first, second) if leads else (second, first)
            least, most = (ratio.min(), ratio.max()) if leads else (1 / ratio.max(), 1 / ratio.min())
            where = f"from {say_count(sizes[0])} to {say_count(sizes[-1])} {panel.unit}"
            yield f"{ahead.name} is {least:.2f} to {most:.2f}{TIMES} as fast as {behind.name} {where}"


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


_HEADINGS = ("at the largest size", "frame, ms", "grows", "plan and build, ms", "grows", "MiB", "grows")
_PREPARATION = "its plan and build"

_ROOM = 20.0
"""How far the axis reaches below the shortest time: where nearly nothing is prepared, the page's table says so."""


def growth_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene and a thing that grows; both axes logarithmic.

    A line is a method at its best split, dotted its plan and build. A ring marks where one overtakes another. Beside
    each panel stand time, preparation and bytes at the largest size, and the fitted exponents of their growth.
    """
    widths = [None, 1, 4, 8, 16]
    names = dict.fromkeys(say_series(method.name, width) for method in METHODS for width in widths)
    return panels.figure_of(
        "lines", [panel.panel(_panel(panel)) for panel in growth_panels(table)], table,
        "dotted: plan and build; ring: one method overtakes another, by ratios within rounds",
        "grows: k of its growth as size to the power of k, fitted over all sizes; MiB: what the method holds by its "
        "own account",
        legend=[*names, _PREPARATION], headings=_HEADINGS,
    )  # fmt: skip


def _panel(panel: Panel) -> drawing.Panel:
    lines, table, notes = [], [], list(say_crossings(panel))
    drawn = list(growths(panel))
    for growth in drawn:
        style, sizes = style_of(growth.method, None), growth.sizes
        ends = growth.low_s * MILLISECONDS, growth.high_s * MILLISECONDS
        lines.append(Line(growth.name, sizes, growth.time_s * MILLISECONDS, style, ends))
        dotted = {"color": style["color"], "linestyle": DOTTED}
        lines.append(Line(_PREPARATION, sizes, growth.preparation_s * MILLISECONDS, dotted, thin=True))
        table.append((growth.name, *_cells(growth)))
    for method, width, points in series_of(panel.rows):
        name = say_series(method, width)
        notes += [*say_unmeasured(points, name), *say_wrong(points, name)]
    least = min((growth.time_s[drawable(growth.time_s)].min(initial=np.inf) for growth in drawn), default=np.inf)
    times = Axis("ms", low=least * MILLISECONDS / _ROOM if np.isfinite(least) else None)
    x = Axis(panel.unit, "ticks", say_count)
    return drawing.Panel(lines=lines, marks=list(_rings(drawn)), notes=notes, table=table, x=x, y=times)


def _cells(growth: Growth) -> list[str]:
    cells = []
    quantities = (growth.time_s, MILLISECONDS), (growth.preparation_s, MILLISECONDS), (growth.bytes, MEBIBYTES)
    for values, unit in quantities:
        slope, known = fitted_slope(growth.sizes, values), values[np.isfinite(values)]
        cells += [say_number(known[-1] * unit) if len(known) else "-", "-" if slope is None else f"k = {slope:.2f}"]
    return cells


def _rings(drawn: list[Growth]) -> Iterator[Mark]:
    """Where two lines pass, or nearly: they were measured hours apart."""
    crossed = [(pair, crossing.size) for pair in combinations(drawn, 2) for crossing in crossings(*pair)]
    for pair, size in sorted(crossed, key=lambda known: known[1]):
        times = [np.interp(np.log(size), np.log(growth.sizes), np.log(growth.time_s)) for growth in pair]
        yield ring(size, float(np.exp(np.mean(times))) * MILLISECONDS, BLACK, drop=True)
