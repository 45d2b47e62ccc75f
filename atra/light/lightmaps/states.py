"""Files that keep an unfinished bake."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.light.lightmaps.baker import Baker


def save_state(baker: Baker, path: Path | str) -> Path:
    """Write what `resume` needs to go on with a bake; returns the path. Raises StorageError."""
    content = io.BytesIO()
    np.savez(content, **baker.state)  # type: ignore[arg-type]
    write_atomically(Path(path), content.getvalue())
    return Path(path)


def resume(baker: Baker, path: Path | str) -> None:
    """Go on with a bake, to the bit as if nothing had interrupted it. Raises InputError for a file that is no state, or
    of another scene, atlas or option."""
    try:
        with np.load(path, allow_pickle=False) as state:
            baker.restore(dict(state))
    except InputError as error:
        raise InputError(f"{path} cannot be resumed: {error}; remove it to start again") from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no state of a bake ({error}); remove it to start again") from None
