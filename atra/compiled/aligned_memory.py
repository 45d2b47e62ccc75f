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
    return aligned_part(np.empty(size + _CACHE_LINE_BYTES, np.uint8), shape, kind)


def aligned_part(memory: NDArray[np.uint8], shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """The array in memory that `aligned_empty` allocated. Raises ValueError for memory of another size."""
    start = -memory.ctypes.data % _CACHE_LINE_BYTES
    size = len(memory) - _CACHE_LINE_BYTES
    return memory[start : start + size].view(kind).reshape(shape)
