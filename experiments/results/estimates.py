"""Numbers with their 95 % confidence intervals: ratios, means, a fitted exponent, and what an interval decides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NOTICEABLE = 1.05
"""A gain whose interval ends below this factor counts as no gain: the measurement was fine enough and found none."""

_STUDENT_T_95 = {3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}
"""Two-sided 95 % points of Student's t by degrees of freedom."""

FEWEST_FITTED = min(_STUDENT_T_95) + 2
"""Points below which no exponent is fitted."""


@dataclass(frozen=True)
class Estimate:
    """A value and its 95 % confidence interval. Raises ValueError when the interval does not contain the value."""

    value: float
    low: float
    high: float

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high:
            raise ValueError(f"interval [{self.low}, {self.high}] does not contain the value {self.value}")

    def over(self, other: Estimate) -> Estimate:
        """The ratio of two positive estimates; its interval reaches from low / high to high / low, which is wider than
        95 % demands."""
        return Estimate(self.value / other.value, self.low / other.high, self.high / other.low)

    def interval(self) -> str:
        return f"[{self.low:.2f}, {self.high:.2f}]"

    def __str__(self) -> str:
        return f"{self.value:.2f} {self.interval()}"


@dataclass(frozen=True)
class Fit:
    """y ~ x ** exponent: the exponent with its interval, and R2 of the straight line through the logarithms."""

    exponent: Estimate
    r_squared: float


def geometric_mean(estimates: Sequence[Estimate]) -> Estimate:
    """Geometric mean of positive estimates that share no measurement; distances to the ends of the intervals add in
    quadrature, in logarithms, each side for itself."""
    center = np.log([one.value for one in estimates])
    below = float(np.sqrt(np.sum((center - np.log([one.low for one in estimates])) ** 2))) / len(estimates)
    above = float(np.sqrt(np.sum((np.log([one.high for one in estimates]) - center) ** 2))) / len(estimates)
    mean = float(center.mean())
    return Estimate(math.exp(mean), math.exp(mean - below), math.exp(mean + above))


def decide_greater(ratio: Estimate, noticeable: float = NOTICEABLE) -> bool | None:
    """Whether `ratio` is above 1: True when its whole interval is, False when the interval ends below `noticeable`
    (the opposite is true, or the difference is too small to notice), None when the interval leaves it open."""
    if ratio.low > 1:
        return True
    return False if ratio.high < noticeable else None


def decide_at_most(value: Estimate, limit: float) -> bool | None:
    """Whether `value` is at most `limit`, by its whole interval; None when the limit lies inside the interval."""
    if value.high <= limit:
        return True
    return False if value.low > limit else None


def fit_exponent(x: Sequence[float], y: Sequence[float]) -> Fit:
    """Least squares through (log x, log y), with Student's interval for the slope.

    x, y: positive, 5 to 11 of each. Raises ValueError for other counts or x that are all alike.
    """
    freedom = len(x) - 2
    if len(x) != len(y) or freedom not in _STUDENT_T_95:
        raise ValueError(f"{len(x)} x and {len(y)} y, expected as many of each, {FEWEST_FITTED} to 11")
    log_x, log_y = np.log(x), np.log(y)
    from_mean = log_x - log_x.mean()
    spread = float(from_mean @ from_mean)
    if spread == 0:
        raise ValueError("all x are alike: no exponent can be fitted")
    slope = float(from_mean @ (log_y - log_y.mean())) / spread
    residuals = log_y - log_y.mean() - slope * from_mean
    left_over, total = float(residuals @ residuals), float(np.sum((log_y - log_y.mean()) ** 2))
    half = _STUDENT_T_95[freedom] * math.sqrt(left_over / freedom / spread)
    # Times that do not change at all follow no power but the zeroth, and that one perfectly.
    r_squared = 1 - left_over / total if total > 0 else 1.0
    return Fit(Estimate(slope, slope - half, slope + half), r_squared)
