"""Resident memory of this process."""

from __future__ import annotations

import sys
from pathlib import Path

import psutil


def rss_bytes() -> int:
    """Bytes of this process that are in physical memory now."""
    return int(psutil.Process().memory_info().rss)


def peak_rss_bytes() -> int:
    """The most bytes of this process that were ever in physical memory at once; never below `rss_bytes` of before."""
    if sys.platform.startswith("linux"):
        # getrusage would do, but Linux lets a child inherit the peak of the process that started it.
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    if sys.platform == "win32":
        return int(psutil.Process().memory_info().peak_wset)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else int(peak) * 1024
