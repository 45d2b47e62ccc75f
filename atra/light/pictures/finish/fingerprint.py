"""A fingerprint of values: equal for equal scenes, cameras and options, in every process."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh


def fingerprint(*values: Any) -> NDArray[np.uint8]:
    """(32,) uint8. values: arrays, numbers, words, None, meshes; sequences, mappings, dataclasses and other objects of
    such."""
    taken = blake2b(digest_size=32)
    _take(taken, values)
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
