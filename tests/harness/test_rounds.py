"""Interleaved rounds and the wait for an idle machine, on clocks and loads that are made up."""

import pytest

from atra.errors import ClockError
from experiments.harness.processes.idle import LIMIT_VARIABLE, Occupancy, Waiting, look_around
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
    measure_rounds({name: clock.method(name, 1.0) for name in "ABC"}, rounds=4, warmup=0, clock=clock)
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


def test_the_budget_stops_between_rounds_once_it_is_spent_and_never_below_the_minimum():
    clock = FakeClock()
    methods = {"A": clock.method("A", 1.0), "B": clock.method("B", 1.0)}
    timed = measure_rounds(methods, rounds=100, warmup=5, budget_s=9.0, clock=clock)
    assert timed.rounds == 5  # 2 s a round: after four rounds 8 s are spent, after five 10 s
    assert len(timed.warmup["A"]) == 5  # warm-ups do not count
    for asked, done in ((9, MINIMUM_ROUNDS), (2, 2)):
        slow = {"A": clock.method("A", 1000.0)}
        assert measure_rounds(slow, rounds=asked, warmup=0, budget_s=1.0, clock=clock).rounds == done
    assert MINIMUM_ROUNDS == 3


@pytest.mark.parametrize(("duration_s", "warmup"), [(0.0, 0), (0.0, 3), (-1e-9, 0), (float("nan"), 0)])
def test_a_clock_that_stands_or_runs_backwards_gives_no_sample(duration_s, warmup):
    clock = FakeClock()
    methods = {"A": clock.method("A", 1.0), "B": clock.method("B", 1.0, duration_s)}
    with pytest.raises(ClockError, match=rf"B took {duration_s:g} s .*measure again"):
        measure_rounds(methods, rounds=3, warmup=warmup, clock=clock)


QUIET, LOUD = Occupancy(0.02, 0.0), Occupancy(0.9, 0.0, (("make", 0.6), ("cc1", 0.3)))


@pytest.fixture
def waiting(monkeypatch):
    """limit and what is seen, one look after another -> a `Waiting` whose clock counts seconds slept, and its words."""
    monkeypatch.delenv(LIMIT_VARIABLE)

    def made(limit_s, *seen):
        said, now, looks = [], [0.0], iter(seen)

        def sleep(seconds):
            now[0] += seconds

        return Waiting(limit_s, said.append, lambda: next(looks), lambda: now[0], sleep), said

    return made


def test_an_idle_machine_is_measured_at_once_and_a_busy_one_waited_for_with_its_processes_named(waiting):
    one, said = waiting(60, QUIET, LOUD, LOUD, QUIET)
    assert one.for_idle()
    assert said == []
    assert one.for_idle()
    (told,) = said
    assert "other processes use 90% of all cores (make 60%, cc1 30%)" in told


def test_the_limit_is_of_all_waits_together_and_then_nobody_waits_again(waiting):
    one, said = waiting(10, LOUD, QUIET, *[LOUD] * 9)
    assert one.for_idle()
    assert not one.for_idle()
    assert "still not idle" in said[-1]
    looked = len(said)
    assert not one.for_idle()
    assert len(said) == looked


def test_looking_around_names_shares_of_cores_and_what_other_machines_steal_counts_too():
    assert not Occupancy(0.0, 0.2).is_idle
    assert "other machines 20%" in str(Occupancy(0.0, 0.2))
    found = look_around(0.2)
    assert found.others_share >= 0
    assert all(share > 0 for _, share in found.names)


def test_the_variable_stands_in_place_of_the_option(monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, "0")
    assert not Waiting(60, print).for_idle()
