"""A lock between processes: one compiles a kernel while the others wait for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

MOST_WAIT_S = 120.0
"""Longest wait for another process, which may have been stopped; after it, one compiles without the lock."""


def lock_between_processes(path: Path) -> tuple[Any, bool]:
    """Lock a file until the lock's `release`, and say whether another process held it at first.

    The lock is None where the folder cannot be written to, the file system knows no locks, or the other process holds
    it for too long: two processes may then compile the same.
    """
    from filelock import FileLock, Timeout  # slow to import, and needed only where something is compiled

    has_waited = False
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path)
        try:
            lock.acquire(timeout=0)
        except Timeout:
            has_waited = True
            lock.acquire(timeout=MOST_WAIT_S, poll_interval=0.02)
    except (OSError, NotImplementedError):  # a Timeout is an OSError
        return None, has_waited
    return lock, has_waited
