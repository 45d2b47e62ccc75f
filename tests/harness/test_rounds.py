"""Interleaved rounds, on a clock that moves only when a method says so."""

import pytest

from atra.errors import ClockError
from experiments.harness.rounds import MINIMUM_ROUNDS, measure_rounds


class FakeClock:
    def __init__(self):
        self.now_s = 0.0
        self.calls = []

    def __call__(self):
        return self.now_s

    def method(self, name, *durations_s):
        """Takes the given times call by call, the last one from then on."""
        remaining = list(durations_s)

        def run():
            self.calls.append(name)
            self.now_s += remaining.pop(0) if len(remaining) > 1 else remaining[0]

        return run


def test_every_method_runs_once_a_round_in_rotating_order():
    clock = FakeClock()
    methods = {name: clock.method(name, 1.0) for name in "ABC"}
    measure_rounds(methods, rounds=4, warmup=0, clock=clock)
    assert "".join(clock.calls) == "ABC" + "BCA" + "CAB" + "ABC"


def test_warm_ups_are_kept_apart_from_samples():
    clock = FakeClock()
    methods = {"A": clock.method("A", 50.0, 40.0, 1.0), "B": clock.method("B", 60.0, 2.0)}
    timed = measure_rounds(methods, rounds=3, warmup=2, clock=clock)
    assert timed.warmup == {"A": (50.0, 40.0), "B": (60.0, 2.0)}
    assert timed.samples == {"A": (1.0, 1.0, 1.0), "B": (2.0, 2.0, 2.0)}
    assert timed.rounds == 3


def test_samples_of_one_round_stay_at_one_index_despite_rotation():
    clock = FakeClock()
    methods = {"A": clock.method("A", 1.0, 2.0, 3.0), "B": clock.method("B", 10.0, 20.0, 30.0)}
    timed = measure_rounds(methods, rounds=3, warmup=0, clock=clock)
    assert [b / a for a, b in zip(timed.samples["A"], timed.samples["B"], strict=True)] == [10.0, 10.0, 10.0]


def test_the_budget_stops_between_rounds_once_it_is_spent():
    clock = FakeClock()
    methods = {"A": clock.method("A", 1.0), "B": clock.method("B", 1.0)}
    timed = measure_rounds(methods, rounds=100, warmup=5, budget_s=9.0, clock=clock)
    assert timed.rounds == 5  # 2 s a round: after four rounds 8 s are spent, after five 10 s
    assert len(timed.warmup["A"]) == 5  # warm-ups do not count


def test_the_budget_never_cuts_below_the_minimum():
    clock = FakeClock()
    timed = measure_rounds({"A": clock.method("A", 1000.0)}, rounds=9, warmup=0, budget_s=1.0, clock=clock)
    assert timed.rounds == MINIMUM_ROUNDS == 3
    timed = measure_rounds({"A": clock.method("A", 1000.0)}, rounds=2, warmup=0, budget_s=1.0, clock=clock)
    assert timed.rounds == 2


@pytest.mark.parametrize(("duration_s", "warmup"), [(0.0, 0), (0.0, 3), (-1e-9, 0), (float("nan"), 0)])
def test_a_clock_that_stands_or_runs_backwards_gives_no_sample(duration_s, warmup):
    clock = FakeClock()
    methods = {"A": clock.method("A", 1.0), "B": clock.method("B", 1.0, duration_s)}
    with pytest.raises(ClockError, match=rf"B took {duration_s:g} s .*measure again"):
        measure_rounds(methods, rounds=3, warmup=warmup, clock=clock)
