"""Statistics of series: medians of rounds, and estimates: means over processes with 95 % confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np

from experiments.harness.column import REAL, Column
from experiments.harness.records import Record

K = TypeVar("K")

CONFIDENCE = 0.95

FEWEST_PROCESSES = 3
"""Below, no interval is given, and nothing is decided."""

FEWEST_FITTED = 5
"""Points below which no exponent is fitted."""


class NotMeasuredError(ValueError):
    """The evidence cannot answer; the text says why."""


def student(freedom: float) -> float:
    """Half the width of Student's 95 % interval, in standard errors."""
    from scipy.special import stdtrit  # as SciPy's statistics below: every worker would pay for importing it

    return float(stdtrit(freedom, (1 + CONFIDENCE) / 2))


@dataclass(frozen=True)
class Pool:
    """The variance of the logarithms of single processes that points of one kind share, and its degrees of freedom."""

    variance: float
    freedom: float

    @classmethod
    def of(cls, points: Iterable[Sequence[float]]) -> Self | None:
        """The pool of the values of points, one value per process; None where no point has two."""
        logs = [np.log(values) for values in points if len(values) > 1 and min(values) > 0]
        freedom = sum(len(group) - 1 for group in logs)
        return cls(float(sum(group.var() * len(group) for group in logs)) / freedom, freedom) if freedom else None


@dataclass(frozen=True)
class Estimate:
    """The geometric mean of independent positive values, and what is known of its error.

    log_mean: of the values' logarithms. variance: of that mean. freedom: its degrees of freedom.
    The interval is Student's, in logarithms: processes are few, and resampling them cannot leave their range, which
    holds the middle of three in no more than 75 % of all cases (tests/results/test_estimates.py simulates it).
    """

    log_mean: float
    variance: float
    freedom: float

    @classmethod
    def of(cls, values: Sequence[float], pool: Pool | None = None) -> Self:
        """One value a process; fewer than FEWEST_PROCESSES have the variance of the pool. Raises NotMeasuredError for
        fewer without a pool and for none, and ValueError for values that are not positive and finite."""
        if not len(values) or (len(values) < FEWEST_PROCESSES and pool is None):
            raise NotMeasuredError(f"{len(values)} processes, at least {FEWEST_PROCESSES} are needed")
        if not all(0 < value < math.inf for value in values):
            raise ValueError(f"values are {list(values)}, expected positive numbers")
        logs = np.log(values)
        if pool is not None and len(logs) < FEWEST_PROCESSES:
            return cls(float(logs.mean()), pool.variance / len(logs), pool.freedom)
        return cls(float(logs.mean()), float(logs.var(ddof=1)) / len(logs), len(logs) - 1)

    @property
    def value(self) -> float:
        return math.exp(self.log_mean)

    @property
    def low(self) -> float:
        return math.exp(self.log_mean - self._half_width)

    @property
    def high(self) -> float:
        return math.exp(self.log_mean + self._half_width)

    @property
    def _half_width(self) -> float:
        if self.variance == 0:
            return 0.0
        return student(self.freedom) * math.sqrt(self.variance)

    def over(self, other: Estimate) -> Estimate:
        """The ratio of two estimates that share no process."""
        return _combine((self, other), (1.0, -1.0))

    def inverse(self) -> Estimate:
        return Estimate(-self.log_mean, self.variance, self.freedom)

    def interval(self) -> str:
        return f"[{self.low:.2f}, {self.high:.2f}]"

    def __str__(self) -> str:
        return f"{self.value:.2f} {self.interval()}"


def _combine(estimates: Sequence[Estimate], weights: Sequence[float]) -> Estimate:
    """The weighted sum of logarithms; degrees of freedom after Welch and Satterthwaite."""
    parts = [weight**2 * estimate.variance for estimate, weight in zip(estimates, weights, strict=True)]
    variance = sum(parts)
    spread = sum(part**2 / estimate.freedom for estimate, part in zip(estimates, parts, strict=True))
    log_mean = sum(weight * estimate.log_mean for estimate, weight in zip(estimates, weights, strict=True))
    return Estimate(log_mean, variance, variance**2 / spread if spread else 1.0)


def geometric_mean(estimates: Sequence[Estimate]) -> Estimate:
    """Geometric mean of estimates that share no process."""
    return _combine(estimates, [1 / len(estimates)] * len(estimates))


@dataclass(frozen=True)
class Sample:
    """A number of one point, in each of its processes. pool: what points of its kind share; None = nobody knows."""

    values: Sequence[float]
    pool: Pool | None = None

    def over(self, other: Sample) -> Sample:
        """Its ratios to another point's, process by process."""
        pool = None if self.pool is None else Pool(2 * self.pool.variance, self.pool.freedom)
        return Sample([own / others for own, others in zip(self.values, other.values, strict=False)], pool)

    def estimate(self) -> Estimate:
        """Raises as `Estimate.of`."""
        return Estimate.of(self.values, self.pool)


def best_of(candidates: Mapping[K, Sequence[float]], pool: Pool | None = None) -> tuple[K, Estimate]:
    """The candidate that is largest in the first half of the processes, and its estimate from the others.

    Choosing and reporting by the same values would overstate the best by the noise that chose it. candidates: by name,
    one value a process.
    Raises NotMeasuredError for no candidate or too few processes, and ValueError as `Estimate.of`.
    """
    if not candidates:
        raise NotMeasuredError("nothing to choose from was measured")
    chosen = max(candidates, key=lambda name: np.log(selection(candidates[name])).mean())
    try:
        return chosen, Estimate.of(holdout(candidates[chosen]), pool)
    except NotMeasuredError as error:
        raise NotMeasuredError(f"to choose the best on some processes and report it on others: {error}") from None


def selection(values: Sequence[float]) -> Sequence[float]:
    """The values that choose the best; the others report it."""
    return values[: max(1, len(values) // 2)]


def holdout(values: Sequence[float]) -> Sequence[float]:
    """The values that report the best."""
    return values[len(selection(values)) :]


@dataclass(frozen=True)
class Interval:
    """A number, of any sign, and its 95 % confidence interval."""

    value: float
    low: float
    high: float

    def interval(self) -> str:
        return f"[{self.low:.2f}, {self.high:.2f}]"


@dataclass(frozen=True)
class Fit:
    """y ~ x ** exponent: the exponent with its interval, and R2 of the straight line through the logarithms."""

    exponent: Interval
    r_squared: float


def fit_exponent(x: Sequence[float], y: Sequence[float]) -> Fit:
    """Least squares through (log x, log y), with Student's interval for the slope.

    x, y: positive, as many of each, at least FEWEST_FITTED. Raises ValueError for fewer or x that are all alike.
    """
    if len(x) != len(y) or len(x) < FEWEST_FITTED:
        raise ValueError(f"{len(x)} x and {len(y)} y, expected as many of each, at least {FEWEST_FITTED}")
    from scipy import stats  # takes a second to import

    line = stats.linregress(np.log(x), np.log(y))
    half = student(len(x) - 2) * float(line.stderr)
    slope = float(line.slope)
    # Times that do not change at all follow no power but the zeroth, and that one perfectly.
    r_squared = 1.0 if np.ptp(y) == 0 else float(line.rvalue) ** 2
    return Fit(Interval(slope, slope - half, slope + half), r_squared)


Series = Callable[[Record], Any]
"""A record -> (rounds,) float64, or None."""


def statistics_columns(name: str, help: str, series: Series) -> tuple[Column, ...]:
    """Median over rounds, geometric mean over processes, and its interval. name: with {} where their parts stand."""

    read = _median(series)
    end = f"end of the 95 % confidence interval of {help}, over processes"
    return (
        Column(name.format(""), REAL, f"median of {help}", read, mean_of),
        Column(name.format("_low"), REAL, f"lower {end}", read, lambda values: _interval(values, 0)),
        Column(name.format("_high"), REAL, f"upper {end}", read, lambda values: _interval(values, 1)),
    )


def choosing_column(name: str, help: str, series: Series) -> Column:
    """The same mean over the first half of the processes alone, by which the best of several points is chosen."""
    text = f"median of {help}, over the processes that choose the best"
    return Column(name, REAL, text, _median(series), lambda values: mean_of(selection(values)))


REST = "_rest"
"""Ends the name of what the processes report that did not choose the best."""


def reporting_columns(name: str, help: str, series: Series) -> tuple[Column, ...]:
    """Mean and interval over the other half, which report the best; a table has them after `with_intervals`."""
    read, text = _median(series), f"{help}, over the processes that report the best"
    middle = Column(f"{name}{REST}", REAL, f"median of {text}", read, lambda values: None)
    ends = (
        Column(f"{name}{REST}_{end}", REAL, f"{end} end of its interval", read, lambda values: None)
        for end in ("low", "high")
    )
    return (middle, *ends)


def _median(series: Series) -> Callable[[Record], float | None]:
    def read(record: Record) -> float | None:
        values = series(record)
        return None if values is None else float(np.median(values))

    return read


def mean_of(values: Sequence[float]) -> float:
    """The geometric mean of numbers that are not negative, which is what intervals are of; 0 if one of them is."""
    if len(values) == 1:
        return values[0]
    with np.errstate(divide="ignore"):
        return float(np.exp(np.log(values).mean()))


def _interval(values: Sequence[float], end: int) -> float | None:
    if len(values) < FEWEST_PROCESSES:
        return None
    estimate = Estimate.of(values)
    return (estimate.low, estimate.high)[end]
