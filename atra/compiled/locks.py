"""A lock between processes: one compiles a kernel while the others wait for it."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

if sys.platform == "win32":

    def _take(file: IO[bytes]) -> bool:
        """Locks nothing."""
        return True

else:
    import fcntl

    def _take(file: IO[bytes]) -> bool:
        """Lock the file if no other process does; returns whether it is this one's now."""
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


MOST_WAIT_S = 120.0
"""Longest wait for another process, which may have been stopped; after it, one compiles without the lock."""

_STEP_S = 0.02


class FileLock:
    """Holds a file locked until `release` or the end of the process. waited: another process held it at first.

    Where files cannot be locked (Windows, some network file systems, a folder that cannot be written to) nothing is
    locked, and two processes may compile the same.
    """

    def __init__(self, path: Path) -> None:
        self.waited = False
        self._file: IO[bytes] | None = None
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("ab")
            end = time.monotonic() + MOST_WAIT_S
            while not _take(self._file) and time.monotonic() < end:
                self.waited = True
                time.sleep(_STEP_S)

    def release(self) -> None:
        """Let others go on."""
        if self._file is not None:
            self._file.close()
            self._file = None
