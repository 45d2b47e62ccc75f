"""Unfinished pictures and bakes as files, and a fingerprint of what they are of."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.mesh import Mesh

Restored = TypeVar("Restored")

_CHANGE_NOTHING = ("threads", "most_samples")


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


def fingerprint(*values: Any, options: Any) -> NDArray[np.uint8]:
    """(32,) uint8, of this version of atra. values: arrays, numbers, words, None, meshes; sequences, mappings,
    dataclasses and other objects of such. options: those that change no sample do not count."""
    taken = blake2b(digest_size=32)
    counted = {name: value for name, value in vars(options).items() if name not in _CHANGE_NOTHING}
    _take(taken, (import_module("atra").__version__, *values, counted))
    return np.frombuffer(taken.digest(), np.uint8)


def _take(taken: Any, value: Any) -> None:
    taken.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        taken.update(f"{value.dtype}{value.shape}".encode())
        taken.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Mesh):
        _take(taken, (value.vertices, value.faces))
    elif value is None or isinstance(value, bool | int | float | str | bytes | np.generic):
        taken.update(repr(value).encode())
    elif isinstance(value, list | tuple):
        taken.update(str(len(value)).encode())
        for one in value:
            _take(taken, one)
    elif isinstance(value, dict):
        _take(taken, sorted(value.items()))
    elif is_dataclass(value):
        _take(taken, [(one.name, getattr(value, one.name)) for one in fields(value)])
    else:
        _take(taken, vars(value))
