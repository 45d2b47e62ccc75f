"""Machine and software that a measurement ran on, which travel with every record, and memory of this process."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Self

import psutil

from atra.compiled.instruction_sets import cpu_design, cpu_features

_CPU_EXTENSIONS = ("sse4.2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")
BUSY_LOAD = 1.0
"""Load from which on a machine is busy before anything is measured."""

_PROJECT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Environment:
    """Where and when a point was measured.

    The fields up to `atra_version` are stable: they belong to the machine and its software. The rest describes the
    moment. A field that cannot be read on this system is None; all are as JSON gives them back.
    instruction_set: the one that Embree and Numba were held to (`atra.compiled.instruction_sets`); None: all that there
    are.
    """

    cpu: str
    cpu_extensions: list[str]
    instruction_set: str | None
    physical_cores: int | None
    logical_cores: int | None
    affinity: list[int] | None
    machine: str
    system: str
    python_version: str
    numpy_version: str | None
    numba_version: str | None
    embree_version: str | None
    embreex_version: str | None
    atra_version: str | None
    system_release: str
    governor: str | None
    load_average: list[float] | None
    memory_total_bytes: int
    memory_available_bytes: int
    git_commit: str | None
    git_dirty: bool | None
    taken_at: str


_NAMES = [spec.name for spec in fields(Environment)]
STABLE_FIELDS = tuple(_NAMES[: _NAMES.index("atra_version") + 1])


def stable_fields(environment: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of an environment (plain values) that must agree before two records may share a ratio or a file.

    `affinity` is the number of cores: a queue binds each job to other cores of a machine; which they are is no matter.
    """
    affinity = environment.get("affinity")
    cores = None if affinity is None else len(affinity)
    return {name: environment.get(name) for name in STABLE_FIELDS} | {"affinity": cores}


def describe_difference(first: Mapping[str, Any], second: Mapping[str, Any]) -> str | None:
    """The first stable field in which two environments (as plain values) differ, with both values; None if none."""
    ours, theirs = stable_fields(first), stable_fields(second)
    for name in STABLE_FIELDS:
        if ours[name] != theirs[name]:
            return f"{name} is {first.get(name)!r} in one and {second.get(name)!r} in the other"
    return None


def read_environment(embree_version: str | None = None, instruction_set: str | None = None) -> Environment:
    """Describe this machine now.

    embree_version: as Embree itself reports it, for example "4.4.0". instruction_set: what `ATRA_ISA` has chosen.
    """
    commit, dirty = _git_state()
    memory = psutil.virtual_memory()
    return Environment(
        cpu=_cpu(),
        cpu_extensions=[name for name in _CPU_EXTENSIONS if name in cpu_features()],
        instruction_set=instruction_set,
        physical_cores=psutil.cpu_count(logical=False),
        logical_cores=psutil.cpu_count(logical=True),
        affinity=sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        machine=platform.machine(),
        system=platform.system(),
        python_version=platform.python_version(),
        numpy_version=package_version("numpy"),
        numba_version=package_version("numba"),
        embree_version=embree_version,
        embreex_version=package_version("embreex"),
        atra_version=package_version("atra"),
        system_release=platform.release(),
        governor=_read(Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")),
        load_average=_load_average(),
        memory_total_bytes=int(memory.total),
        memory_available_bytes=int(memory.available),
        git_commit=commit,
        git_dirty=dirty,
        taken_at=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def _load_average() -> list[float] | None:
    if not hasattr(os, "getloadavg"):
        return None
    try:
        return list(os.getloadavg())
    except OSError:  # the system may not tell
        return None


def _cpu() -> str:
    """What the system calls the processor, and its design: virtual machines may give processors of years one name."""
    model, design = _cpu_model(), cpu_design()
    return model if design is None else f"{model} ({design})"


@cache
def _cpu_model() -> str:
    for line in (_read(Path("/proc/cpuinfo")) or "").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    if sys.platform == "darwin":
        brand = _output(["sysctl", "-n", "machdep.cpu.brand_string"])
        if brand:
            return brand
    return platform.processor() or platform.machine() or "unknown"


def _git_state() -> tuple[str | None, bool | None]:
    """Commit of the project and whether its tree differs from it; (None, None) outside a repository of its own."""
    if not (_PROJECT / ".git").exists():
        return None, None
    commit = _output(["git", "-C", str(_PROJECT), "rev-parse", "--verify", "HEAD"])
    changes = _output(["git", "-C", str(_PROJECT), "status", "--porcelain"])
    return commit or None, None if changes is None else bool(changes)


def package_version(package: str) -> str | None:
    """The version of an installed package, None where it is missing; nothing is imported."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _read(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return None


def _output(command: list[str]) -> str | None:
    try:
        done = subprocess.run(command, capture_output=True, encoding="utf-8", errors="replace", timeout=20, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


MEMORY_SHARE = 0.75
"""Default memory budget of a point, as a share of free memory; below 1, since a plan's need is an estimate."""


def memory_budget_bytes(budget_gib: float | None) -> int:
    """What a point may take now. budget_gib: None = `MEMORY_SHARE` of the memory that is free."""
    if budget_gib is None:
        return int(MEMORY_SHARE * psutil.virtual_memory().available)
    return int(budget_gib * 2**30)


def rss_bytes() -> int:
    """Bytes of this process that are in physical memory now."""
    return int(psutil.Process().memory_info().rss)


def peak_rss_bytes() -> int:
    """The most bytes of this process that were in physical memory at once since `reset_peak_rss`, or ever."""
    if sys.platform.startswith("linux"):
        # getrusage would do, but Linux lets a child inherit the peak of the process that started it.
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else int(peak) * 1024


def reset_peak_rss() -> bool:
    """Let `peak_rss_bytes` count from now on; False where the system offers no such thing, and it counts from the
    start."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="utf-8")
    except OSError:
        return False
    return True


BUSY_SHARE_OF_ALL_CORES = 0.05
"""Part of the time of all cores that a process may use, up to which a machine is idle: other processes and other
machines together may take it. Beyond it a sweep waits before it measures, and what was measured is flagged. An idle
system takes less; on two cores it is a tenth of one core."""

_SHORTEST_S = 0.1
"""Systems count busy cores in hundredths of a second."""

_NOT_BUSY = ("idle", "iowait", "steal", "guest", "guest_nice")  # guests count in `user` and `nice`, too


@dataclass(frozen=True)
class Occupancy:
    """Shares of the time of all cores that the process may use, 0 to 1.

    others_share: of other processes, which it has not started. stolen_share: of other machines on the same hardware,
    None where unknown.
    """

    others_share: float
    stolen_share: float | None


def own_processor_time_s() -> float:
    """Seconds of processor time that this process and all its descendants have used, those that have ended included.

    A descendant that ends between two calls is counted in both: a process inherits the times of children it waited for,
    though not on Windows.
    """
    reaped = os.times()
    total_s = time.process_time() + reaped.children_user + reaped.children_system
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            spent = child.cpu_times()
            total_s += spent.user + spent.system
            total_s += getattr(spent, "children_user", 0.0) + getattr(spent, "children_system", 0.0)
    return total_s


@dataclass(frozen=True)
class Moment:
    """Clock time and processor time so far, in seconds: of this process with its descendants, of all processes on its
    cores, and of other machines on the same hardware. Reading them takes milliseconds, so it stays out of timings.
    """

    clock_s: float
    own_s: float
    busy_s: float
    stolen_s: float | None
    cores: int

    @classmethod
    def now(cls) -> Self:
        process, cores = psutil.Process(), psutil.cpu_times(percpu=True)
        if hasattr(process, "cpu_affinity"):  # macOS has none
            cores = [cores[number] for number in process.cpu_affinity()]
        busy_s = sum(getattr(core, name) for core in cores for name in core._fields if name not in _NOT_BUSY)
        stolen_s = sum(core.steal for core in cores) if hasattr(cores[0], "steal") else None
        return cls(time.perf_counter(), own_processor_time_s(), busy_s, stolen_s, len(cores))

    def until(self, later: Moment) -> Occupancy | None:
        """Between the two moments; None where they are too close to tell."""
        between_s = later.clock_s - self.clock_s
        if between_s < _SHORTEST_S:
            return None
        of_all = 1 / (between_s * self.cores)
        others_s = (later.busy_s - self.busy_s) - (later.own_s - self.own_s)
        stolen_s = None if self.stolen_s is None or later.stolen_s is None else later.stolen_s - self.stolen_s
        # The clocks are not read at the very same moment.
        return Occupancy(max(others_s * of_all, 0.0), None if stolen_s is None else max(stolen_s * of_all, 0.0))
