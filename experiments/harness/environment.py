"""Machine and software that a measurement ran on, which travel with every record, and memory of this process."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import psutil

from atra.compiled.instruction_sets import cpu_design, cpu_features

_CPU_EXTENSIONS = ("sse4.2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")
BUSY_LOAD = 1.0
"""Load from which on a machine is busy before anything is measured."""

_PROJECT = Path(__file__).resolve().parents[2]


STABLE_FIELDS = (
    "cpu", "cpu_extensions", "instruction_set", "physical_cores", "logical_cores", "affinity", "machine", "system",
    "python_version", "numpy_version", "numba_version", "embree_version", "embreex_version", "atra_version",
)  # fmt: skip
"""Fields of an environment that belong to the machine and its software; the others describe the moment."""


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


def read_environment(embree_version: str | None = None, instruction_set: str | None = None) -> dict[str, Any]:
    """Where and when a point is measured, as JSON has it; what cannot be read on this system is None.

    embree_version: as Embree itself reports it, for example "4.4.0". instruction_set: the one that Embree and Numba are
    held to (`atra.compiled.instruction_sets`), None: all that there are.
    """
    commit, is_dirty = _git_state()
    memory = psutil.virtual_memory()
    return {
        "cpu": _cpu(),
        "cpu_extensions": [name for name in _CPU_EXTENSIONS if name in cpu_features()],
        "instruction_set": instruction_set,
        "physical_cores": psutil.cpu_count(logical=False),
        "logical_cores": psutil.cpu_count(logical=True),
        "affinity": sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        "machine": platform.machine(),
        "system": platform.system(),
        "python_version": platform.python_version(),
        "numpy_version": package_version("numpy"),
        "numba_version": package_version("numba"),
        "embree_version": embree_version,
        "embreex_version": package_version("embreex"),
        "atra_version": package_version("atra"),
        "system_release": platform.release(),
        "governor": _read(Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")),
        "load_average": _load_average(),
        "memory_total_bytes": int(memory.total),
        "memory_available_bytes": int(memory.available),
        "git_commit": commit,
        "git_dirty": is_dirty,
        "taken_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }


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
