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
class Panel(panels.PanelRows):
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
        "lines", [one.panel(_panel(one)) for one in growth_panels(table)], table,
        "dotted: plan and build; ring: one method overtakes another, by ratios within rounds",
        "grows: k of its growth as size to the power of k, fitted over all sizes; MiB: what the method holds by its "
        "own account",
        legend=[*names, _PREPARATION], headings=_HEADINGS,
    )  # fmt: skip


def _panel(panel: Panel) -> drawing.Panel:
    lines, table, notes = [], [], list(say_crossings(panel))
    drawn = list(growths(panel))
    for one in drawn:
        style = style_of(one.method, None)
        interval = (one.low_s * MILLISECONDS, one.high_s * MILLISECONDS)
        lines.append(Line(one.name, one.sizes, one.time_s * MILLISECONDS, style, interval))
        dotted = {"color": style["color"], "linestyle": DOTTED}
        lines.append(Line(_PREPARATION, one.sizes, one.preparation_s * MILLISECONDS, dotted, thin=True))
        table.append((one.name, *_cells(one)))
    for method, width, points in series_of(panel.rows):
        name = say_series(method, width)
        notes += [*say_unmeasured(points, name), *say_wrong(points, name)]
    least = [one.time_s[drawable(one.time_s)].min() for one in drawn if drawable(one.time_s).any()]
    low = min(least) * MILLISECONDS / _ROOM if least else None
    sizes, times = Axis(panel.unit, "ticks", say_count), Axis("ms", low=low)
    return drawing.Panel(lines=lines, marks=list(_rings(drawn)), notes=notes, table=table, x=sizes, y=times)


def _cells(one: Growth) -> list[str]:
    cells = []
    for values, unit in ((one.time_s, MILLISECONDS), (one.preparation_s, MILLISECONDS), (one.bytes, MEBIBYTES)):
        slope = fitted_slope(one.sizes, values)
        known = values[np.isfinite(values)]
        cells += [say_number(known[-1] * unit) if len(known) else "-", "-" if slope is None else f"k = {slope:.2f}"]
    return cells


def _rings(drawn: list[Growth]) -> Iterator[Mark]:
    """Where two lines pass, or nearly: they were measured hours apart."""
    found = [(one, other, at.size) for one, other in combinations(drawn, 2) for at in crossings(one, other)]
    for one, other, size in sorted(found, key=lambda crossing: crossing[2]):
        times = [np.interp(np.log(size), np.log(of.sizes), np.log(of.time_s)) for of in (one, other)]
        yield ring(size, float(np.exp(np.mean(times))) * MILLISECONDS, BLACK, drop=True)
