"""Run a kernel on several threads that share one work counter."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from atra.errors import InputError


def resolve_threads(threads: int | None) -> int:
    """The number of threads to use; None is every core this process may run on."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int) or threads < 1:
        raise InputError(f"threads is {threads!r}, expected a whole number of at least 1, or None for every core")
    return threads


class WorkerPool:
    """`threads` threads, the caller among them, that run a kernel side by side until its shared counter is used up."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._executor = ThreadPoolExecutor(threads - 1, "atra") if threads > 1 else None

    def run(self, kernel: Callable[[int, int], Any]) -> None:
        """Call kernel(worker, counter_address) once per thread; the counter at the address starts at zero."""
        counter = np.zeros(1, np.int64)
        address = counter.ctypes.data
        others = []
        if self._executor:
            others = [self._executor.submit(kernel, worker, address) for worker in range(1, self.threads)]
        try:
            kernel(0, address)
        finally:
            for other in others:
                other.result()

    def close(self) -> None:
        if self._executor:
            self._executor.shutdown()
