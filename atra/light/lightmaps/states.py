"""Files that keep an unfinished bake."""

from __future__ import annotations

from pathlib import Path

from atra.light.lightmaps.baker import Baker
from atra.light.pictures.finish.states import read_state, write_state


def save_state(baker: Baker, path: Path | str) -> Path:
    """Write what `resume` needs to go on with a bake; returns the path. Raises StorageError."""
    write_state(Path(path), baker.state)
    return Path(path)


def resume(baker: Baker, path: Path | str) -> None:
    """Go on with a bake, to the bit as if nothing had interrupted it. Raises InputError for a file that is no state, or
    of another scene, atlas or option."""
    read_state(path, baker.restore, "bake")
