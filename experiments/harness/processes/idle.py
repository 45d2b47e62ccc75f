"""An idle machine: a sweep waits while other processes, or other machines on the same hardware, use its cores."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import psutil

from atra.errors import InputError
from experiments.harness.environment import BUSY_SHARE_OF_ALL_CORES, Moment

LIMIT_VARIABLE = "ATRA_IDLE_LIMIT_S"
"""Environment variable in place of `measure.idle_limit_s`; tests, which measure nothing, set it to 0."""

_LOOK_S = 1.0
_PAUSE_S = 4.0
_MOST_NAMED, _LEAST_NAMED = 3, BUSY_SHARE_OF_ALL_CORES / 10
"""How many processes are named, and the share of all cores from which one is."""


@dataclass(frozen=True)
class Busy:
    """What uses the cores. others, stolen: what other processes and other machines take of the time of all cores, 0 to
    1. names: of the processes that take most, each with its share of all cores."""

    others: float
    stolen: float
    names: tuple[tuple[str, float], ...] = ()

    @property
    def is_idle(self) -> bool:
        return self.others + self.stolen <= BUSY_SHARE_OF_ALL_CORES

    def __str__(self) -> str:
        named = ", ".join(f"{name} {share:.0%}" for name, share in self.names)
        stolen = f", other machines {self.stolen:.0%}" if self.stolen > _LEAST_NAMED else ""
        return f"other processes use {self.others:.0%} of all cores{f' ({named})' * bool(named)}{stolen}"


def look_around(seconds: float = _LOOK_S) -> Busy:
    """What uses the cores of this process for so many seconds, this process and its descendants not counted."""
    own = {os.getpid(), *(child.pid for child in psutil.Process().children(recursive=True))}
    others = [process for process in psutil.process_iter(["name"]) if process.pid not in own]
    start = Moment.now()
    for process in others:
        _cores_used(process)
    time.sleep(seconds)
    busy = start.until(Moment.now())
    if busy is None:
        return Busy(0.0, 0.0)
    used = [(str(process.info["name"]), _cores_used(process) / start.cores) for process in others]
    most = sorted(used, key=lambda user: -user[1])[:_MOST_NAMED]
    return Busy(busy.others_share, busy.stolen_share or 0.0, tuple(user for user in most if user[1] > _LEAST_NAMED))


def _cores_used(process: psutil.Process) -> float:
    """How many cores a process has used since the last call; none where it has ended, or is not ours to look at."""
    with suppress(psutil.Error):
        return float(process.cpu_percent()) / 100
    return 0.0


@dataclass
class Waiting:
    """Waits for an idle machine, `limit_s` seconds in all; tell is called once for each wait, with what is waited for,
    and once when the time is used up. needed: then InputError is raised."""

    limit_s: float
    tell: Callable[[str], None]
    needed: bool = False
    look: Callable[[], Busy] = look_around
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    spent_s: float = 0.0

    def __post_init__(self) -> None:
        self.limit_s = float(os.environ.get(LIMIT_VARIABLE, self.limit_s))

    def for_idle(self) -> bool:
        """Whether the machine is idle, at once or after some waiting. False as soon as the time is used up, or
        InputError where it is needed."""
        if self.spent_s >= self.limit_s:
            return self._given_up()
        start, told = self.clock(), False
        while not (busy := self.look()).is_idle:
            waited = self.spent_s + self.clock() - start
            if waited >= self.limit_s:
                self.spent_s = waited
                self.tell(f"the machine is still not idle after {waited:.0f} s: {busy}")
                return self._given_up()
            if not told:
                self.tell(f"waiting for an idle machine, {self.limit_s - waited:.0f} s at most: {busy}")
                told = True
            self.sleep(_PAUSE_S)
        self.spent_s += self.clock() - start if told else 0.0
        return True

    def tell_who_disturbs(self) -> bool:
        """Look once and say who uses the cores, without waiting. Whether the machine is idle; where it must be,
        as `for_idle`."""
        if self.needed or self.limit_s <= 0:
            return self.for_idle()
        busy = self.look()
        if not busy.is_idle:
            self.tell(f"the machine is not idle: {busy}; measuring goes on, and the table flags what was disturbed")
        return busy.is_idle

    def _given_up(self) -> bool:
        if self.needed and self.limit_s > 0:
            raise InputError("the machine is not idle; the same command goes on from here")
        return False
