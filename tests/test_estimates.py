"""Numbers with intervals against hand calculations."""

from __future__ import annotations

import math

import pytest

from experiments.results.estimates import Estimate, decide_greater, fit_exponent, geometric_mean


def test_intervals_of_ratios_and_means_are_wide_enough_and_decide_only_what_they_exclude() -> None:
    assert Estimate(4, 2, 8).over(Estimate(2, 1, 4)) == Estimate(2, 0.5, 8)
    mean = geometric_mean([Estimate(1, 0.5, 2)] * 4)
    assert (mean.value, mean.low, mean.high) == pytest.approx((1, 0.5**0.5, 2**0.5))  # in quadrature
    ratios = (Estimate(1.1, 1.01, 1.2), Estimate(1.1, 0.99, 1.2), Estimate(1.01, 0.99, 1.04))
    assert [decide_greater(ratio) for ratio in ratios] == [True, None, False]


def test_a_fitted_exponent_and_its_interval_agree_with_a_hand_calculation() -> None:
    # log x = 0 ... 4, log y = 0, 1, 2, 3, 5: slope 1.2, residual sum 0.4, so 3.182 sqrt(0.4 / 3 / 10).
    fit = fit_exponent([math.exp(x) for x in range(5)], [math.exp(y) for y in (0, 1, 2, 3, 5)])
    assert fit.exponent.value == pytest.approx(1.2)
    assert fit.exponent.high - 1.2 == pytest.approx(3.182 * math.sqrt(0.4 / 3 / 10))
    assert fit.r_squared == pytest.approx(1 - 0.4 / 14.8)
