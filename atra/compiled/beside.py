"""Compiling kernels in another process, while this one compiles others: Numba compiles one at a time in a process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from threading import Thread
from typing import Any

from atra.compiled.progress import QUIET_VARIABLE
from atra.compiled.store import cache_folder, is_kept
from atra.compiled.threads import resolve_threads

VARIABLE = "ATRA_COMPILE_BESIDE"
"""Set to 0, everything is compiled in this process."""


def compile_beside(kernel: Any, function: Callable[..., None], *arguments: Any) -> None:
    """Unless `kernel` is kept on disk, call `function`, which compiles it, in another process; returns at once.

    A process that needs the kernel meanwhile waits for it. function: defined in a module; its arguments survive `repr`.
    Does nothing on one core, and where kernels cannot be kept.
    """
    may_start = os.environ.get(VARIABLE) != "0" and sys.executable and not getattr(sys, "frozen", False)
    if not may_start or kernel.overloads or is_kept(kernel) or cache_folder() is None or resolve_threads(None) < 2:
        return
    call = f"from {function.__module__} import {function.__name__} as f; f(*{arguments!r})"
    variables = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), QUIET_VARIABLE: "1", VARIABLE: "0"}
    nowhere = subprocess.DEVNULL
    try:
        process = subprocess.Popen(
            [sys.executable, "-c", call], env=os.environ | variables, stdin=nowhere, stdout=nowhere, stderr=nowhere
        )
    except OSError:  # no process can be started here; then this one compiles everything
        return
    Thread(target=process.wait, daemon=True).start()
