"""Statistics of a series: the median of a process's rounds, and over processes its mean and confidence interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from experiments.harness.column import REAL, Column
from experiments.harness.records import Record
from experiments.results.estimates import FEWEST_PROCESSES, Estimate, first_half

Series = Callable[[Record], Any]
"""A record -> (rounds,) float64, or None."""


def statistics_columns(name: str, help: str, series: Series) -> tuple[Column, ...]:
    """Median over rounds, geometric mean over processes, and its interval. name: with {} where their parts stand."""

    read = _median(series)
    end = f"end of the 95 % confidence interval of {help}, over processes"
    return (
        Column(name.format(""), REAL, f"median of {help}", read, _mean),
        Column(name.format("_low"), REAL, f"lower {end}", read, lambda values: _interval(values, 0)),
        Column(name.format("_high"), REAL, f"upper {end}", read, lambda values: _interval(values, 1)),
    )


def choosing_column(name: str, help: str, series: Series) -> Column:
    """The same mean over the first half of the processes alone, by which the best of several points is chosen."""
    text = f"median of {help}, over the processes that choose the best"
    return Column(name, REAL, text, _median(series), lambda values: _mean(first_half(values)))


def _median(series: Series) -> Callable[[Record], float | None]:
    def read(record: Record) -> float | None:
        values = series(record)
        return None if values is None else float(np.median(values))

    return read


def _mean(values: Sequence[float]) -> float:
    return values[0] if len(values) == 1 else float(np.exp(np.log(values).mean()))


def _interval(values: Sequence[float], end: int) -> float | None:
    if len(values) < FEWEST_PROCESSES:
        return None
    estimate = Estimate.of(values)
    return (estimate.low, estimate.high)[end]
