"""Compiled kernels are kept on disk between runs, as long as no file they may be made of has changed."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit

from atra import hits
from atra.embree import layout
from atra.instruction_sets import limit_numba

limit_numba()

_SOURCES = (*sorted(Path(__file__).parent.glob("*.py")), Path(str(layout.__file__)), Path(str(hits.__file__)))

SOURCE_STAMP = zlib.crc32(b"".join(source.read_bytes() for source in _SOURCES))
"""Changes with every file that a kernel may be made of: all kernels, the struct layouts, the constants of hits."""


def _cache_folder() -> str | None:
    try:
        return str(njit(cache=True)(lambda: None).stats.cache_path)
    except RuntimeError:  # Numba found no folder it may write to
        return None


CACHE_FOLDER = _cache_folder()
"""Where compiled kernels are kept; None where Numba may write nowhere: every process then compiles them anew."""


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` when it is first called, to run without the GIL, and keep the code in `CACHE_FOLDER`, if any.

    Numba runs kept code as long as the file of the function itself is the same. Kernels inline functions of other files
    and their constants, so here all sources count: an older one would otherwise be run after an update.
    """
    compiled = njit(nogil=True, cache=CACHE_FOLDER is not None)(function)
    if CACHE_FOLDER is not None:
        compiled._cache._cache_file._source_stamp = SOURCE_STAMP
    return compiled
