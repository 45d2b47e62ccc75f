"""Estimates against hand calculations, and what is called 95 % against simulated processes."""

import math

import numpy as np
import pytest

from experiments.results.statistics import Estimate, Interval, best_of, fit_exponent, geometric_mean
from experiments.results.verdicts import decide_greater

SIMULATIONS = 2000
EDGE = 4 * math.sqrt(0.95 * 0.05 / SIMULATIONS)
"""Four standard errors of a coverage that is 95 %."""


def test_an_interval_is_student_s_of_the_logarithms():
    one = Estimate.of([math.exp(1), math.exp(2), math.exp(3)])
    half = 4.302652730 / math.sqrt(3)  # 97.5 % point for two degrees of freedom
    assert (one.value, one.low, one.high) == pytest.approx((math.exp(2), math.exp(2 - half), math.exp(2 + half)))
    alike = Estimate.of([2.0, 2.0, 2.0])
    assert (alike.value, alike.low, alike.high) == pytest.approx((2, 2, 2))


@pytest.mark.parametrize("values", [[], [1.0, 2.0], [1.0, 2.0, 0.0], [1.0, 2.0, math.nan], [1.0, 2.0, math.inf]])
def test_too_few_processes_and_impossible_values_have_no_interval(values):
    with pytest.raises(ValueError, match=r"at least 3 are needed|expected positive numbers"):
        Estimate.of(values)


def test_a_ratio_and_a_mean_have_welch_s_degrees_of_freedom():
    few, many = Estimate(1.0, 0.5, 2), Estimate(3.0, 0.25, 4)
    ratio = few.over(many)
    assert (ratio.log_mean, ratio.variance) == (-2.0, 0.75)
    assert ratio.freedom == pytest.approx(0.75**2 / (0.5**2 / 2 + 0.25**2 / 4))
    assert ratio.over(ratio).log_mean == 0
    mean = geometric_mean([few, many])
    assert (mean.log_mean, mean.variance) == (2.0, 0.1875)
    assert few.inverse().value == pytest.approx(1 / few.value)


def test_a_limit_inside_the_interval_is_left_open():
    cases = {(1.01, 1.2): True, (0.99, 1.2): None, (0.8, 0.99): False, (0.8, 1.0): None}
    for (low, high), decided in cases.items():
        assert decide_greater(Interval(1.0, low, high)) is decided


def log_normal(random, count):
    return np.exp(random.normal(0, 0.02, count))


def heavy_tailed(random, count):
    return np.exp(0.02 * random.standard_t(3, count))


def skewed(random, count):
    return np.exp(0.02 * (random.exponential(1.0, count) - 1))


QUOTED = [
    (log_normal, 3, 95, 97), (log_normal, 5, 95, 96), (log_normal, 9, 95, 95),
    (heavy_tailed, 3, 96, 97), (heavy_tailed, 5, 96, 97), (heavy_tailed, 9, 96, 96),
    (skewed, 3, 88, 98), (skewed, 5, 88, 97), (skewed, 9, 90, 96),
]  # fmt: skip
"""Percent of the intervals of a number and of a ratio that cover it, as docs/trust.md has them, of 300,000 each."""


@pytest.mark.parametrize(("draw", "processes", "of_number", "of_ratio"), QUOTED)
def test_what_is_called_95_percent_covers_that_much_of_a_ratio_and_unless_skewed_of_a_number(
    draw, processes, of_number, of_ratio
):
    random = np.random.default_rng(1)
    numbers = [Estimate.of(draw(random, processes).tolist()) for _ in range(2 * SIMULATIONS)]
    ratios = [one.over(other) for one, other in zip(numbers[:SIMULATIONS], numbers[SIMULATIONS:], strict=True)]
    for estimates, percent in ((numbers, of_number), (ratios, of_ratio)):
        covered = np.mean([one.low <= 1 <= one.high for one in estimates])
        assert covered == pytest.approx(percent / 100, abs=EDGE + 0.005)
        assert covered > 0.95 - EDGE or percent < 95


@pytest.mark.parametrize("lead", [0.0, 0.01, 0.05])
def test_the_interval_of_the_chosen_best_covers_what_it_is_and_not_what_chance_made_of_it(lead):
    random = np.random.default_rng(2)
    truth = np.zeros(11)
    truth[4] = lead
    covered, excess, naive = [], [], []
    for _ in range(SIMULATIONS):
        logs = truth[:, None] + random.normal(0, 0.02, (11, 5))
        chosen, found = best_of({name: np.exp(logs[name]).tolist() for name in range(11)})
        covered.append(found.low <= math.exp(truth[chosen]) <= found.high)
        excess.append(found.log_mean - truth[chosen])
        naive.append(logs.mean(axis=1).max() - truth[chosen])
    assert np.mean(covered) > 0.95 - EDGE
    assert abs(np.mean(excess)) < 0.001
    if lead == 0:
        assert np.mean(naive) > 0.01


def test_a_fitted_exponent_and_its_interval_agree_with_a_hand_calculation():
    # log x = 0 ... 4, log y = 0, 1, 2, 3, 5: slope 1.2, residual sum 0.4, so 3.1824 sqrt(0.4 / 3 / 10).
    fit = fit_exponent([math.exp(x) for x in range(5)], [math.exp(y) for y in (0, 1, 2, 3, 5)])
    assert fit.exponent.value == pytest.approx(1.2)
    assert fit.exponent.high - 1.2 == pytest.approx(3.182446 * math.sqrt(0.4 / 3 / 10), rel=1e-5)
    assert fit.r_squared == pytest.approx(1 - 0.4 / 14.8)
    with pytest.raises(ValueError, match="at least 5"):
        fit_exponent([1.0, 2.0], [1.0, 2.0])
