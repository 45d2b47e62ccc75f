"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

from atra.errors import StorageError

_UNFINISHED = ".unfinished"


def remove_abandoned_files(folder: Path) -> None:
    """Remove what killed writers left in `folder`; nobody may be writing there.

    What cannot be removed is left: on Windows another program may look at it.
    """
    for path in folder.glob(f".*{_UNFINISHED}"):
        with contextlib.suppress(OSError):
            path.unlink()


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, flush it to the disk, then rename it onto `path`.

    Raises StorageError, naming file and reason, when that fails; what `path` held before is still there then.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=_UNFINISHED)
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp files are private; results are for everyone the folder lets in.
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException as error:
        if temporary is not None:
            with contextlib.suppress(OSError):
                Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise StorageError(
                f"{path} cannot be written: {error.strerror or error}; what was there before is untouched. "
                f"{path.parent} needs free space and the right to write, and on Windows no other program may have the "
                "file open; then start again"
            ) from error
        raise
