"""What others took of the cores of a process while it measured, on systems that are faked, and on this one."""

import subprocess
import sys
import time
from collections import namedtuple
from dataclasses import replace

import psutil
import pytest

from experiments.harness.processes.idle import Moment, Occupancy

Linux = namedtuple("Linux", "user nice system idle iowait irq softirq steal guest guest_nice")
Mac = namedtuple("Mac", "user nice system idle")


class Childless:
    def children(self, recursive):
        return []


class Process(Childless):
    def cpu_affinity(self):
        return [1]


def test_only_the_cores_that_it_may_use_count_and_guests_count_once(monkeypatch):
    cores = [Linux(900, 0, 0, 0, 0, 0, 0, 500, 0, 0), Linux(10, 2, 3, 100, 50, 1, 1, 4, 5, 1)]
    monkeypatch.setattr(psutil, "Process", Process)
    monkeypatch.setattr(psutil, "cpu_times", lambda percpu: cores)
    moment = Moment.now()
    assert (moment.busy_s, moment.stolen_s, moment.cores) == (17, 4, 1)


def test_a_system_without_affinity_and_steal_tells_of_all_its_cores(monkeypatch):
    monkeypatch.setattr(psutil, "Process", Childless)
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


WORK = """
import subprocess, sys, time
while time.process_time() < {seconds}: pass
inner = sys.argv[1:] and subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=subprocess.PIPE)
print(inner and inner.wait(), flush=True)
sys.stdin.read()
"""
"""Uses that much processor time, runs the program that it is given, and waits for its input to end, as an external
program does for the next frame."""


def working(seconds, *inner):
    code = WORK.format(seconds=seconds)
    return subprocess.Popen([sys.executable, "-c", code, *inner], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def spent_by_others_s(start, end):
    """By the process's descendants, between two moments: beside what it took itself."""
    return end[0].own_s - start[0].own_s - (end[1] - start[1])


@pytest.mark.skipif(sys.platform == "win32", reason="Windows tells nothing of a process that has ended")
def test_what_a_child_computes_is_no_disturbance_while_it_runs_and_after_it_has_ended():
    start = Moment.now(), time.process_time()
    child = working(0.3)
    child.stdout.readline()
    running = Moment.now(), time.process_time()
    child.communicate()
    ended = Moment.now(), time.process_time()
    assert spent_by_others_s(start, running) + 0.05 >= 0.3  # clocks of different steps
    assert spent_by_others_s(start, ended) >= spent_by_others_s(start, running) - 0.05


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells what a child has waited for")
def test_what_a_child_of_a_child_computed_counts_once_it_has_ended_too():
    start = Moment.now(), time.process_time()
    child = working(0.1, WORK.format(seconds=0.3).replace("sys.stdin.read()", ""))
    child.stdout.readline()
    running = Moment.now(), time.process_time()
    child.communicate()
    assert spent_by_others_s(start, running) + 0.05 >= 0.4
    assert spent_by_others_s(start, (Moment.now(), time.process_time())) + 0.05 >= 0.4


def test_on_this_machine_shares_are_shares():
    start = Moment.now()
    while time.perf_counter() - start.clock_s < 0.2:
        pass
    found = start.until(Moment.now())
    assert 0.0 <= found.others_share <= 1.1
