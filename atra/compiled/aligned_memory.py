"""Arrays that start at a cache line, which streaming stores (past the caches) need."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

_CACHE_LINE_BYTES = 64


def aligned_empty(shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """An uninitialised array that shares its memory with nothing else."""
    size = prod(shape) * np.dtype(kind).itemsize
    memory = np.empty(size + _CACHE_LINE_BYTES, np.uint8)
    start = -memory.ctypes.data % _CACHE_LINE_BYTES
    return memory[start : start + size].view(kind).reshape(shape)
