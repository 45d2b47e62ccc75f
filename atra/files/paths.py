"""Atomic writing: files are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from atra.errors import StorageError

UNFINISHED = ".unfinished"
"""Suffix of files that are being written; a killed writer leaves them."""


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to a temporary file beside `path`, flush it to the disk and rename it to `path`.

    Raises StorageError, naming file and reason, if that fails; `path` is then unchanged.
    """
    write_together({path: content})


def write_together(contents: Mapping[Path, bytes]) -> None:
    """`write_atomically` for files that belong together: a disk without room for the last leaves all as they were.

    Raises StorageError, naming the file that failed.
    """
    temporary: dict[Path, str] = {}
    path = Path()
    try:
        for path, content in contents.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary[path] = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=UNFINISHED)
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            # Files of mkstemp are private; results are for everyone who may read the folder.
            os.chmod(temporary[path], 0o644)
        for path in contents:
            os.replace(temporary[path], path)
    except BaseException as error:
        for unfinished in temporary.values():
            with contextlib.suppress(OSError):
                Path(unfinished).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise StorageError(
                f"{path} cannot be written: {error.strerror or error}; its old content is untouched. {path.parent} "
                "needs free space and write permission, and on Windows no other program may have the file open"
            ) from error
        raise
