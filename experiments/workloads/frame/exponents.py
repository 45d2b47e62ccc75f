"""Exponents of growth: fitted to ratios within rounds, which no slow moment of the machine moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.values import drawable
from experiments.methods.pixel import PIXEL
from experiments.results.statistics import FEWEST_PROCESSES, Interval, student
from experiments.workloads.frame.growth import Growth, Panel, fitted_slope, growth_panels, growths

_FEWEST_SIZES = 3


def exponents(processes: pd.DataFrame) -> Iterator[tuple[Panel, str, Interval]]:
    """A panel and a method: k of the growth of its time over that of packets, as size to the power of k.

    Packets themselves: k of their time. Each process is fitted by itself, and the interval is Student's over processes;
    of fewer than three it is that of the straight line through all sizes. processes: rows of each that measured.
    """
    found: dict[tuple[str, str], tuple[Panel, list[Growth]]] = {}
    for _, rows in processes.groupby(processes["process"].fillna(0), sort=True):
        for panel in growth_panels(rows):
            for one in growths(panel):
                found.setdefault((panel.title, one.method), (panel, []))[1].append(one)
    for (_, method), (panel, several) in found.items():
        interval = _over_processes(several)
        if interval is not None:
            yield panel, method, interval


def _values(one: Growth) -> NDArray[np.float64]:
    return one.time_s if one.method == PIXEL.name else 1.0 / one.over_packets


def _over_processes(several: Sequence[Growth]) -> Interval | None:
    slopes = [slope for one in several if (slope := fitted_slope(one.sizes, _values(one))) is not None]
    if not slopes:
        return None
    middle = float(np.mean(slopes))
    if len(slopes) >= FEWEST_PROCESSES:
        half = student(len(slopes) - 1) * float(np.std(slopes, ddof=1)) / np.sqrt(len(slopes))
        return Interval(middle, middle - half, middle + half)
    sizes, values = (
        np.concatenate(parts) for parts in zip(*((one.sizes, _values(one)) for one in several), strict=True)
    )
    known = drawable(values)
    if len(np.unique(sizes[known])) < _FEWEST_SIZES:
        return None
    from scipy import stats  # takes a second to import

    line = stats.linregress(np.log(sizes[known]), np.log(values[known]))
    half = student(int(known.sum()) - 2) * float(line.stderr)
    return Interval(float(line.slope), float(line.slope) - half, float(line.slope) + half)


def exponent_lines(processes: pd.DataFrame) -> Iterator[str]:
    """What grows how, for the terminal."""
    for panel, method, k in exponents(processes):
        what = "a frame of packets" if method == PIXEL.name else f"{method} over packets"
        yield f"{panel.title}: {what} grows as {panel.unit}^{k.value:.2f} {k.interval()}"
