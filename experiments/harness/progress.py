"""What is running, what is left and when it will be done: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from types import TracebackType

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from atra.errors import printable

_ENOUGH = 3
"""Fewest points whose median time predicts the rest; the first may have waited for kernels to compile."""


class SweepProgress:
    """Progress over `total` points; a context manager.

    clock: seconds, monotonic.
    """

    def __init__(self, total: int, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        self._total = total
        self._console = console
        self._clock = clock
        self._done = 0
        self._begun_s = clock()
        self._took_s: list[float] = []
        self._bar = Progress(
            SpinnerColumn(),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.description}"),
            console=console,
            disable=not console.is_terminal,
            transient=True,
        )
        self._task = self._bar.add_task("", total=total, left="")

    def __enter__(self) -> SweepProgress:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def begin(self, label: str) -> None:
        """A point starts."""
        self._bar.update(self._task, description=escape(printable(label)), left=self._left())

    def end(self, label: str, outcome: str) -> None:
        """The point begun last is done, or the next of several begun together. outcome: what came of it, a line, and
        further lines that are told below it."""
        self._done += 1
        now_s = self._clock()
        self._took_s.append(now_s - self._begun_s)
        self._begun_s = now_s
        self._bar.update(self._task, completed=self._done, left=self._left())
        count = f"[{self._done:>{len(str(self._total))}}/{self._total}]"
        left = "" if self._console.is_terminal else f" ({self._left()})"
        first, *further = outcome.split("\n")
        say(self._console, f"{count} {label}: {first}{left}")
        for line in further:
            say(self._console, f"    {line}")

    def _left(self) -> str:
        remaining = self._total - self._done
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
