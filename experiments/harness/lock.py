"""One run at a time in one results folder: two would spoil each other's times and records."""

from __future__ import annotations

import json
import os
import platform
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

from filelock import FileLock, Timeout

from atra.errors import InputError, StorageError
from atra.files import remove_abandoned_files, write_atomically


@contextmanager
def exclusive(results: Path, *folders: Path) -> Iterator[None]:
    """Hold the results folder for this run; the system lets go of it when the process ends, however it ends.

    There are two locks: one in the folder, for whoever shares it, and one among the temporary files of this machine,
    which stays when the folder is deleted during the run. What a killed run left half-written there and in `folders`
    is removed. Raises InputError naming who holds the folder, and StorageError if it cannot be locked.
    """
    user = getattr(os, "getuid", int)()
    digest = sha256(os.fsencode(results.resolve())).hexdigest()[:20]
    elsewhere = Path(tempfile.gettempdir()) / f"atra-lock-{user}-{digest}"
    with _held(results / ".lock", results), _held(elsewhere, results):
        try:
            for folder in (results, *folders):
                remove_abandoned_files(folder)
            yield
        finally:
            with suppress(OSError):
                elsewhere.unlink()  # the one in the folder, which stays, keeps those out who have opened this one


@contextmanager
def _held(path: Path, results: Path) -> Iterator[None]:
    lock, holder = FileLock(path), path.with_name(path.name + ".holder")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise InputError(
            f"{results} is in use by {_describe(holder)}; wait for it to end or choose another results_dir"
        ) from None
    except OSError as error:
        raise StorageError(
            f"{results} cannot be locked: {error.strerror or error}; choose another results_dir"
        ) from None
    try:
        started = datetime.now(UTC).isoformat(timespec="seconds")
        words = " ".join(["python", *sys.argv])
        told = {"process": os.getpid(), "machine": platform.node(), "since": started, "command": words}
        write_atomically(holder, json.dumps(told).encode())
        yield
    finally:
        with suppress(OSError):
            holder.unlink(missing_ok=True)
        lock.release()


def _describe(holder: Path) -> str:
    try:
        told = json.loads(holder.read_text(encoding="utf-8"))
        return f"process {told['process']} on {told['machine']} since {told['since']} ({told['command']})"
    except (OSError, ValueError, KeyError, TypeError):
        return "another run"
