"""A model's file among the arguments of a verb, as in `atra view model.glb`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from atra.errors import InputError


def take_model_file(given: Sequence[str]) -> list[str]:
    """Arguments with `scene=file scene.path=...` in place of the name of a model's file.

    A name is an argument without "=" that ends in a suffix, as model.glb does. Raises InputError where no such file is.
    """
    taken: list[str] = []
    for one in given:
        if "=" in one or one.startswith(("-", "~")) or not Path(one).suffix:
            taken.append(one)
        elif Path(one).is_file():
            quoted = one.replace("'", "\\'")  # Hydra keeps other backslashes of a quoted text
            taken += ["scene=file", f"scene.path='{quoted}'"]
        else:
            raise InputError(f"there is no file {one!r}; fields are set with '=', as in scene=cornell_box")
    return taken
