"""Files that keep unfinished pictures and bakes."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from atra.errors import InputError
from atra.files.paths import write_atomically

Restored = TypeVar("Restored")


def write_state(path: Path, state: Mapping[str, Any]) -> None:
    """Write arrays by name. Raises StorageError."""
    content = io.BytesIO()
    np.savez(content, **state)
    write_atomically(path, content.getvalue())


def read_state(path: Path | str, restore: Callable[[dict[str, Any]], Restored], whole: str) -> Restored:
    """What `restore` returns for the arrays of a file, which are of a `whole` such as "picture".

    Raises InputError naming the file if it is no such state, or if `restore` refuses it.
    """
    try:
        with np.load(path, allow_pickle=False) as state:
            return restore(dict(state))
    except InputError as error:
        raise InputError(f"{path} cannot be resumed: {error}; remove it to start again") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no state of a {whole} ({error}); remove it to start again") from None
