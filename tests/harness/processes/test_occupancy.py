"""What others took of the cores of a process while it measured, on systems that are faked, and on this one."""

import time
from collections import namedtuple
from dataclasses import replace

import psutil

from experiments.harness.environment import Moment, Occupancy

Linux = namedtuple("Linux", "user nice system idle iowait irq softirq steal guest guest_nice")
Mac = namedtuple("Mac", "user nice system idle")


class Process:
    def cpu_affinity(self):
        return [1]


def test_only_the_cores_that_it_may_use_count_and_guests_count_once(monkeypatch):
    cores = [Linux(900, 0, 0, 0, 0, 0, 0, 500, 0, 0), Linux(10, 2, 3, 100, 50, 1, 1, 4, 5, 1)]
    monkeypatch.setattr(psutil, "Process", Process)
    monkeypatch.setattr(psutil, "cpu_times", lambda percpu: cores)
    moment = Moment.now()
    assert (moment.busy_s, moment.stolen_s, moment.cores) == (17, 4, 1)


def test_a_system_without_affinity_and_steal_tells_of_all_its_cores(monkeypatch):
    monkeypatch.setattr(psutil, "Process", object)
    monkeypatch.setattr(psutil, "cpu_times", lambda percpu: [Mac(1, 0, 2, 9), Mac(4, 0, 0, 9)])
    moment = Moment.now()
    assert (moment.busy_s, moment.stolen_s, moment.cores) == (7, None, 2)
    later = replace(moment, clock_s=moment.clock_s + 1, busy_s=7.5)
    assert moment.until(later) == Occupancy(0.25, None)


def test_its_own_time_is_not_that_of_others_and_a_moment_is_too_short_to_tell():
    start = Moment(clock_s=10.0, own_s=1.0, busy_s=50.0, stolen_s=3.0, cores=2)
    assert start.until(Moment(20.0, 9.0, 59.0, 4.0, 2)) == Occupancy(0.05, 0.05)
    assert start.until(Moment(20.0, 11.0, 59.9, 3.0, 2)) == Occupancy(0.0, 0.0)  # clocks of different steps
    assert start.until(replace(start, clock_s=10.09)) is None


def test_on_this_machine_shares_are_shares():
    start = Moment.now()
    while time.perf_counter() - start.clock_s < 0.2:
        pass
    found = start.until(Moment.now())
    assert 0.0 <= found.others_share <= 1.1
