"""Worker threads that run a kernel together and share one work counter."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from threading import get_native_id
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.whole_numbers import is_whole_number

MOST_THREADS = 1024
"""Upper limit of the number of threads: each takes memory and time to start, and no machine of today has more cores."""

core_of_caller: Callable[[], int] = ctypes.PyDLL(None).sched_getcpu if sys.platform == "linux" else lambda: -1
"""The core that the calling thread runs on, as numbered by `os.sched_getaffinity`; -1 but on Linux.

`PyDLL` keeps the GIL, which is faster than releasing it.
"""


def resolve_threads(threads: int | None) -> int:
    """The number of threads to use; None = every core this process may run on. Raises InputError below 1."""
    if threads is None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return min(cores, MOST_THREADS)
    if not is_whole_number(threads) or threads < 1:
        raise InputError(
            f"threads is {threads!r}, expected a whole number of at least 1, or None (null in a configuration) "
            "for every core"
        )
    if threads > MOST_THREADS:
        raise InputError(f"threads is {threads}, expected at most {MOST_THREADS}; None takes every core")
    return int(threads)


class WorkerPool:
    """`threads` threads, the caller's among them, that run a kernel together.

    A pool that is dropped without `close` ends its threads by itself.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._start()

    def _start(self) -> None:
        self._process = os.getpid()
        self._others: dict[int, set[int]] = {}  # other threads by native id: the cores each was last allowed
        self._executor = None
        if self.threads > 1:
            # Its threads know `_others` alone, not this pool: an executor that nothing refers to ends its threads.
            self._executor = ThreadPoolExecutor(self.threads - 1, "atra", _note_thread, (self._others,))

    def _keep_off_core_of_caller(self) -> None:
        """Let the other threads run on every core but the caller's (Linux only).

        Otherwise Linux often wakes them on the caller's core and moves them only after a frame is done.
        """
        if sys.platform != "linux":
            return
        cores = os.sched_getaffinity(0)
        others = cores - {core_of_caller()} if self.threads <= len(cores) else cores
        for thread, given in list(self._others.items()):  # a copy, as threads may still be starting
            if given != others:
                with suppress(OSError):  # it serves speed alone, and a container may forbid it
                    os.sched_setaffinity(thread, others)
                self._others[thread] = others

    def run(self, kernel: Callable[[int, int], Any], most_threads: int = MOST_THREADS) -> None:
        """Call kernel(worker, counter_address) once in each of at most `most_threads` threads; the counter starts at 0.

        Returns when all threads are done, since they write to the caller's memory; raises what one of them raised.
        """
        if self._process != os.getpid():  # a child of fork has none of its parent's threads
            self._start()
        counter = np.zeros(1, np.int64)
        address = counter.ctypes.data
        others: list[Future[Any]] = []
        try:
            if self._executor and most_threads > 1:
                self._keep_off_core_of_caller()
                for worker in range(1, min(self.threads, most_threads)):
                    others.append(self._executor.submit(kernel, worker, address))
            kernel(0, address)
        finally:
            _wait_whatever_happens(others)
        for other in others:
            other.result()

    def close(self) -> None:
        if self._executor:
            self._executor.shutdown()


def _note_thread(others: dict[int, set[int]]) -> None:
    others[get_native_id()] = set()


def _wait_whatever_happens(others: list[Future[Any]]) -> None:
    """Wait for all, even if Ctrl-C interrupts the waiting; raise the interruption afterwards."""
    interruption: BaseException | None = None
    while True:
        try:
            for other in others:
                other.exception()  # cheaper than `concurrent.futures.wait`
        except BaseException as error:
            interruption = error
        else:
            break
    if interruption is not None:
        raise interruption
