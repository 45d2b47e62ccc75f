"""Says on standard error, once, that kernels are being compiled, where that takes longer than a second."""

from __future__ import annotations

import os
import sys
import threading

QUIET_VARIABLE = "ATRA_QUIET"
"""Set to anything but 0, nothing is said."""

_PATIENCE_S = 1.0

_lock = threading.Lock()
_depth = 0  # kernels being compiled now: one may call for another
_count = 0  # kernels compiled so far
_said = False
_timer: threading.Timer | None = None


def begin() -> None:
    """A kernel is about to be compiled."""
    global _depth, _timer
    with _lock:
        _depth += 1
        if _timer is None and not _is_quiet():
            _timer = threading.Timer(_PATIENCE_S, _say)
            _timer.daemon = True
            _timer.start()


def end() -> None:
    """A kernel has been compiled."""
    global _depth, _count
    with _lock:
        _depth, _count = max(0, _depth - 1), _count + 1
        if _said and _is_terminal():  # a line of its own, which goes when there is nothing left to compile
            _write(f"\r\x1b[K{_count} kernels" if _depth else "\r\x1b[K")


def _say() -> None:
    global _said, _timer
    with _lock:
        if _depth:
            _said = True
            _write("atra: compiling kernels for this machine, once\n")
        else:  # what was compiled took no time; look again when there is more
            _timer = None


def _write(text: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(text)
        sys.stderr.flush()


def _is_terminal() -> bool:
    return sys.stderr is not None and sys.stderr.isatty()


def _is_quiet() -> bool:
    return os.environ.get(QUIET_VARIABLE, "0") not in ("", "0")
