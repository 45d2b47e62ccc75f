"""Resident memory of this process."""

from __future__ import annotations

import sys
from pathlib import Path

import psutil


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
