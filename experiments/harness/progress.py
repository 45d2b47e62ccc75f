"""What is running, what is left and when it will be done: a line a point, and on a terminal the one that runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from statistics import median

from rich.console import Console
from rich.markup import escape

from atra.errors import printable

_ENOUGH = 3
"""Fewest points whose median time predicts the rest; the first may have waited for kernels to compile."""


class SweepProgress(AbstractContextManager["SweepProgress"]):
    """Progress over `total` points. clock: seconds, monotonic."""

    def __init__(self, total: int, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        self._total, self._console, self._clock = total, console, clock
        self._begun_s = clock()
        self._took_s: list[float] = []
        self._running = console.status("")  # shown on a terminal alone

    def __enter__(self) -> SweepProgress:
        self._running.start()
        return self

    def __exit__(self, *raised: object) -> None:
        self._running.stop()

    def begin(self, label: str) -> None:
        """A point starts."""
        self._running.update(escape(printable(label)))

    def end(self, label: str, outcome: str) -> None:
        """The point begun last is done, or the next of several begun together. outcome: what came of it, a line, and
        further lines that are told below it."""
        now_s = self._clock()
        self._took_s.append(now_s - self._begun_s)
        self._begun_s = now_s
        done = len(self._took_s)
        first, *further = outcome.split("\n")
        say(self._console, f"[{done:>{len(str(self._total))}}/{self._total}] {label}: {first} ({self._left()})")
        for line in further:
            say(self._console, f"    {line}")

    def _left(self) -> str:
        remaining = self._total - len(self._took_s)
        if remaining == 0:
            return "none left"
        if len(self._took_s) < _ENOUGH:
            return f"{remaining} left"
        return f"{remaining} left, about {say_duration(median(self._took_s) * remaining)}"


def say_duration(seconds: float) -> str:
    """Hours and minutes, minutes and seconds, or seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def say_roughly(seconds: float) -> str:
    """A duration that is only known roughly: tens of seconds, then minutes, then tenths of an hour."""
    if seconds < 100:
        return f"{max(10, 10 * round(seconds / 10))} s"
    return f"{round(seconds / 60)} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def say(console: Console, text: str) -> None:
    """Print one line as it is: no markup, no colours, no line breaks of our own, and what it quotes made printable."""
    console.print(printable(text), markup=False, highlight=False, soft_wrap=True)
