"""A sweep waits for an idle machine, says for what, and gives up after a limit. No clock, no load: both are made up."""

import pytest

from experiments.harness.processes.idle import LIMIT_VARIABLE, Occupancy, Waiting, look_around

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


def test_an_idle_machine_is_measured_at_once(waiting):
    one, said = waiting(60, QUIET)
    assert one.for_idle()
    assert said == []


def test_a_busy_one_is_waited_for_and_the_processes_are_named(waiting):
    one, said = waiting(60, LOUD, LOUD, QUIET, QUIET)
    assert one.for_idle()
    assert one.for_idle()
    assert len(said) == 1
    assert "other processes use 90% of all cores (make 60%, cc1 30%)" in said[0]


def test_the_limit_is_of_all_waits_together_and_then_nobody_waits_again(waiting):
    one, said = waiting(10, LOUD, QUIET, *[LOUD] * 9)
    assert one.for_idle()
    assert not one.for_idle()
    assert "still not idle" in said[-1]
    looked = len(said)
    assert not one.for_idle()
    assert len(said) == looked


def test_what_other_machines_steal_counts_too():
    assert not Occupancy(0.0, 0.2).is_idle
    assert "other machines 20%" in str(Occupancy(0.0, 0.2))


def test_the_variable_stands_in_place_of_the_option(monkeypatch):
    monkeypatch.setenv(LIMIT_VARIABLE, "0")
    assert not Waiting(60, print).for_idle()


def test_looking_around_names_shares_of_cores():
    found = look_around(0.2)
    assert found.others_share >= 0
    assert all(share > 0 for _, share in found.names)
