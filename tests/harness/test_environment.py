"""The machine's description on other systems, which are faked: what they lack, and where they keep it."""

import os
import platform
import sys
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
from tests.harness.processes.test_outcome import POINT


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


@pytest.mark.parametrize("is_repository", [False, True])
def test_outside_a_repository_and_without_git_there_is_no_commit(is_repository, tmp_path, monkeypatch):
    if is_repository:
        (tmp_path / ".git").mkdir()
        monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(environment, "_PROJECT", tmp_path)
    assert environment._git_state() == (None, None)


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
