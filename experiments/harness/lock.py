"""One run at a time in one results folder: two would spoil each other's times and records."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from atra.errors import InputError, StorageError
from atra.files.paths import remove_abandoned_files


@contextmanager
def exclusive(results: Path, *folders: Path) -> Iterator[None]:
    """Hold the results folder for this run; the system lets go of it when the process ends, however it ends.

    What a killed run left half-written there and in `folders` is removed. Raises InputError if another run holds it,
    and StorageError if it cannot be locked.
    """
    lock = FileLock(results / ".lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise InputError(
            f"{results} is in use by another run; wait for it to end or choose another results_dir"
        ) from None
    except OSError as error:  # a file system that knows no locks
        raise StorageError(f"{results} cannot be locked: {error}; choose another results_dir") from None
    try:
        for folder in (results, *folders):
            remove_abandoned_files(folder)
        yield
    finally:
        lock.release()
