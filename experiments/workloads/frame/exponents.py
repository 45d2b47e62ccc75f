"""Exponents of growth: fitted to ratios within rounds, which no slow moment of the machine moves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.values import drawable
from experiments.methods.pixel import PIXEL
from experiments.results.statistics import FEWEST_FITTED, FEWEST_PROCESSES, Interval, fit_exponent, student
from experiments.workloads.frame.growth import Growth, Panel, fitted_slope, growth_panels, growths


def exponents(processes: pd.DataFrame) -> Iterator[tuple[Panel, str, Interval]]:
    """A panel and a method: k of the growth of its time over that of packets, as size to the power of k.

    Packets themselves: k of their time. Each process is fitted by itself, and the interval is Student's over processes;
    of fewer than three it is that of the straight line through all sizes. processes: rows of each that measured.
    """
    known: dict[tuple[str, str], tuple[Panel, list[Growth]]] = {}
    for _, rows in processes.groupby(processes["process"].fillna(0), sort=True):
        for panel in growth_panels(rows):
            for growth in growths(panel):
                known.setdefault((panel.title, growth.method), (panel, []))[1].append(growth)
    for (_, method), (panel, several) in known.items():
        interval = _over_processes(several)
        if interval is not None:
            yield panel, method, interval


def _values(growth: Growth) -> NDArray[np.float64]:
    return growth.time_s if growth.method == PIXEL.name else 1.0 / growth.over_packets


def _over_processes(several: Sequence[Growth]) -> Interval | None:
    slopes = [slope for growth in several if (slope := fitted_slope(growth.sizes, _values(growth))) is not None]
    if len(slopes) >= FEWEST_PROCESSES:
        middle = float(np.mean(slopes))
        half = student(len(slopes) - 1) * float(np.std(slopes, ddof=1)) / np.sqrt(len(slopes))
        return Interval(middle, middle - half, middle + half)
    sizes, values = np.concatenate([(growth.sizes, _values(growth)) for growth in several], axis=1)
    known = drawable(values)
    is_enough = known.sum() >= FEWEST_FITTED and len(np.unique(sizes[known])) > 1
    return fit_exponent(sizes[known], values[known]).exponent if is_enough else None


def exponent_lines(processes: pd.DataFrame) -> Iterator[str]:
    """What grows how, for the terminal."""
    for panel, method, k in exponents(processes):
        what = "a frame of packets" if method == PIXEL.name else f"{method} over packets"
        yield f"{panel.title}: {what} grows as {panel.unit}^{k.value:.2f} {k.interval()}"
