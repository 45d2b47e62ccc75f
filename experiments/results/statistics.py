"""Statistics of rounds: medians, quartiles and confidence intervals, and the columns that hold them."""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.harness.column import REAL, Column
from experiments.harness.records import Record

CONFIDENCE = 0.95

Series = Callable[[Record], Any]
"""A record -> (rounds,) float64, or None."""

_PARTS = {
    "": ("median of ", lambda values: float(np.quantile(values, 0.5))),
    "_q1": ("lower quartile of ", lambda values: float(np.quantile(values, 0.25))),
    "_q3": ("upper quartile of ", lambda values: float(np.quantile(values, 0.75))),
    "_low": ("lower end of the 95 % confidence interval of the median of ", lambda values: median_interval(values)[0]),
    "_high": ("upper end of the 95 % confidence interval of the median of ", lambda values: median_interval(values)[1]),
}


def statistics_columns(name: str, help: str, series: Series) -> tuple[Column, ...]:
    """Median, quartiles and confidence interval of a series. name: with {} where their parts stand."""

    def column(part: str) -> Column:
        words, statistic = _PARTS[part]

        def read(record: Record) -> Any:
            values = series(record)
            return None if values is None else statistic(values)

        return Column(name.format(part), REAL, words + help, read)

    return tuple(column(part) for part in _PARTS)


def median_interval(values: NDArray[np.float64], confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Confidence interval of the median from order statistics, which assumes no distribution.

    The k-th smallest and k-th largest value enclose the median unless fewer than k samples fall on one side of it,
    which is binomial; k is the largest that keeps the confidence. Below 6 samples even k = 1 does not reach 95 %: the
    interval is then their whole range.
    """
    ordered = np.sort(values)
    count, miss, k = len(ordered), 0.0, 1
    for fewer in range(count // 2):
        miss += 2 * comb(count, fewer) / 2**count
        if miss > 1 - confidence:
            break
        k = fewer + 1
    return float(ordered[k - 1]), float(ordered[-k])
