"""Memory from a cache line's start on: kernels may write to it past the caches."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_CACHE_LINE_BYTES = 64


def aligned_empty(shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """An uninitialised array, whose memory nothing else shares."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    return aligned_part(np.empty(size + _CACHE_LINE_BYTES, np.uint8), shape, kind)


def aligned_part(memory: NDArray[np.uint8], shape: tuple[int, ...], kind: type[np.generic]) -> NDArray[Any]:
    """The array in the memory of an `aligned_empty`. Raises ValueError for less memory."""
    start = -memory.ctypes.data % _CACHE_LINE_BYTES
    size = len(memory) - _CACHE_LINE_BYTES
    return memory[start : start + size].view(kind).reshape(shape)
