"""A plugin of coverage: Numba compiles untraced. Its compiler is none of ours, and takes twice as long when traced."""

import functools
import sys
from collections.abc import Callable
from typing import Any

from coverage import CoveragePlugin


def untraced(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same without a tracer, which is taken away and given back in one frame: coverage counts calls and returns."""

    @functools.wraps(function)
    def call(*given: Any, **named: Any) -> Any:
        tracer = sys.gettrace()
        sys.settrace(None)
        try:
            return function(*given, **named)
        finally:
            sys.settrace(tracer)

    return call


class Untraced(CoveragePlugin):
    """Is shown every file that is run first, and waits for one after Numba: many a process never imports that."""

    def __init__(self) -> None:
        self._waits = True

    def file_tracer(self, filename: str) -> None:
        if self._waits and hasattr(sys.modules.get("numba"), "njit"):
            from numba.core.ccallback import CFunc
            from numba.core.dispatcher import _FunctionCompiler

            self._waits = False
            _FunctionCompiler.compile = untraced(_FunctionCompiler.compile)
            CFunc._compile_uncached = untraced(CFunc._compile_uncached)


def coverage_init(registry: Any, options: Any) -> None:
    """What coverage calls in every process that it measures."""
    registry.add_file_tracer(Untraced())
