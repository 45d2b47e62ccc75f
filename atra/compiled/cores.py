"""The core that a thread runs on, asked of the C library."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

core_of_caller: Callable[[], int] = ctypes.PyDLL(None).sched_getcpu if sys.platform == "linux" else lambda: -1
"""The number of the core that the calling thread runs on now, as in `os.sched_getaffinity`; -1 but on Linux.

`PyDLL` keeps the GIL, which takes less time than to give it back.
"""
