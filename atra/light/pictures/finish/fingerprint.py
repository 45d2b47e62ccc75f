"""A fingerprint of values: equal for equal scenes, cameras and options, in every process."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from hashlib import blake2b
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh

_CHANGE_NOTHING = ("threads", "most_samples")


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
