"""The machine's description, and what others took of its cores, on systems that are faked and on this one."""

import os
import platform
import subprocess
import sys
import time
from collections import namedtuple
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import llvmlite.binding
import psutil
import pytest

from atra.compiled.instruction_sets import cpu_design
from atra.compiled.threads import resolve_threads
from experiments.harness import environment
from experiments.harness.environment import describe_difference, read_environment
from experiments.harness.identity import identity
from experiments.harness.processes.idle import Moment, Occupancy
from tests.points import POINT


def test_a_system_without_affinity_and_load_is_described_without(monkeypatch):
    def unobtainable():
        raise OSError("Load averages are unobtainable")

    monkeypatch.setattr(os, "getloadavg", unobtainable, raising=False)
    assert read_environment()["load_average"] is None
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)  # macOS, Windows
    monkeypatch.delattr(os, "getloadavg", raising=False)  # Windows
    described = read_environment()
    assert (described["affinity"], described["load_average"]) == (None, None)
    assert resolve_threads(None) == os.cpu_count()


@pytest.mark.parametrize(("system", "cpuinfo", "sysctl", "processor", "expected"), [
    ("linux", "processor: 0\nmodel name\t: AMD EPYC\n", None, "x86_64", "AMD EPYC"),
    ("linux", "processor: 0\nBogoMIPS: 50\n", None, "", "machine"),  # Arm has no model name
    ("darwin", None, "Apple M2", "arm", "Apple M2"),
    ("darwin", None, None, "arm", "arm"),
    ("win32", None, None, "AMD64 Family 25, AuthenticAMD", "AMD64 Family 25, AuthenticAMD"),
])  # fmt: skip
def test_the_processor_is_named_by_what_each_system_has(system, cpuinfo, sysctl, processor, expected, monkeypatch):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(environment, "_read", lambda _: cpuinfo)
    monkeypatch.setattr(environment, "_output", lambda _: sysctl)
    monkeypatch.setattr(platform, "processor", lambda: processor)
    monkeypatch.setattr(platform, "machine", lambda: "machine")
    assert environment._cpu_model.__wrapped__() == expected


@pytest.mark.parametrize(
    ("known_to_llvm", "expected"), [("znver3", "AMD EPYC (znver3)"), ("generic", "AMD EPYC"), ("", "AMD EPYC")]
)
def test_processors_of_one_name_are_told_apart_by_their_design(known_to_llvm, expected, monkeypatch):
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_name", lambda: known_to_llvm)
    monkeypatch.setattr(environment, "cpu_design", cpu_design.__wrapped__)
    monkeypatch.setattr(environment, "_cpu_model", lambda: "AMD EPYC")
    assert read_environment()["cpu"] == expected


@pytest.mark.parametrize(
    ("system", "expected"), [("win32", 7_000_000), ("darwin", 5_000_000), ("freebsd14", 5_000_000 * 1024)]
)
def test_the_peak_of_memory_is_read_in_the_unit_of_each_system(system, expected, monkeypatch):
    usage = SimpleNamespace(ru_maxrss=5_000_000)
    monkeypatch.setitem(sys.modules, "resource", SimpleNamespace(getrusage=lambda _: usage, RUSAGE_SELF=0))
    monkeypatch.setattr(psutil.Process, "memory_info", lambda _: SimpleNamespace(peak_wset=7_000_000))
    monkeypatch.setattr(sys, "platform", system)
    assert environment.peak_rss_bytes() == expected


def test_a_system_without_proc_counts_the_peak_from_the_start(monkeypatch):
    def absent(*_, **__):
        raise FileNotFoundError("/proc/self/clear_refs")

    monkeypatch.setattr(Path, "write_text", absent)
    assert environment.reset_peak_rss() is False


def test_other_cores_of_one_machine_are_the_same_environment_and_another_number_of_them_is_not():
    one = read_environment()
    first, second, both, unknown = (one | {"affinity": cores} for cores in ([0], [1], [0, 1], None))
    assert describe_difference(first, second) is None
    assert identity(POINT, first) == identity(POINT, second) != identity(POINT, both)
    assert describe_difference(second, both) == "affinity is [1] in one and [0, 1] in the other"
    assert describe_difference(both, unknown) == "affinity is [0, 1] in one and None in the other"


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
