"""An idle machine: a sweep waits while other processes, or other machines on the same hardware, use its cores."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import psutil

LIMIT_VARIABLE = "ATRA_IDLE_LIMIT_S"
"""Environment variable in place of `measure.idle_limit_s`; tests, which measure nothing, set it to 0."""

BUSY_SHARE_OF_ALL_CORES = 0.05
"""Part of the time of all cores that a process may use, up to which a machine is idle: other processes and other
machines together may take it. Beyond it a sweep waits before it measures, and what was measured is flagged. An idle
system takes less; on two cores it is a tenth of one core."""

_SHORTEST_S = 0.1
"""Systems count busy cores in hundredths of a second."""

_NOT_BUSY = ("idle", "iowait", "steal", "guest", "guest_nice")  # guests count in `user` and `nice`, too

_LOOK_S = 1.0
_PAUSE_S = 4.0
_MOST_NAMED, _LEAST_NAMED = 3, BUSY_SHARE_OF_ALL_CORES / 10
"""How many processes are named, and the share of all cores from which one is."""


@dataclass(frozen=True)
class Occupancy:
    """Shares of the time of all cores that the process may use, 0 to 1.

    others_share: of other processes, which it has not started. stolen_share: of other machines on the same hardware,
    None where unknown. names: of the processes that take most, each with its share.
    """

    others_share: float
    stolen_share: float | None
    names: tuple[tuple[str, float], ...] = ()

    @property
    def shares(self) -> dict[str, float | None]:
        """As results of a record have them."""
        return {"others_share": self.others_share, "stolen_share": self.stolen_share}

    @property
    def is_idle(self) -> bool:
        return self.others_share + (self.stolen_share or 0.0) <= BUSY_SHARE_OF_ALL_CORES

    def __str__(self) -> str:
        named = ", ".join(f"{name} {share:.0%}" for name, share in self.names)
        stolen = f", other machines {self.stolen_share:.0%}" if (self.stolen_share or 0.0) > _LEAST_NAMED else ""
        return f"other processes use {self.others_share:.0%} of all cores{f' ({named})' * bool(named)}{stolen}"


def own_processor_time_s() -> float:
    """Seconds of processor time that this process and all its descendants have used, those that have ended included.

    A descendant that ends between two calls is counted in both: a process inherits the times of children it waited for,
    though not on Windows.
    """
    reaped = os.times()
    total_s = time.process_time() + reaped.children_user + reaped.children_system
    for child in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):  # it has just ended
            spent = child.cpu_times()
            total_s += spent.user + spent.system
            total_s += getattr(spent, "children_user", 0.0) + getattr(spent, "children_system", 0.0)
    return total_s


@dataclass(frozen=True)
class Moment:
    """Clock time and processor time so far, in seconds: of this process with its descendants, of all processes on its
    cores, and of other machines on the same hardware. Reading them takes milliseconds, so it stays out of timings.
    """

    clock_s: float
    own_s: float
    busy_s: float
    stolen_s: float | None
    cores: int

    @classmethod
    def now(cls) -> Self:
        process, cores = psutil.Process(), psutil.cpu_times(percpu=True)
        if hasattr(process, "cpu_affinity"):  # macOS has none
            cores = [cores[number] for number in process.cpu_affinity()]
        busy_s = sum(getattr(core, name) for core in cores for name in core._fields if name not in _NOT_BUSY)
        stolen_s = sum(core.steal for core in cores) if hasattr(cores[0], "steal") else None
        return cls(time.perf_counter(), own_processor_time_s(), busy_s, stolen_s, len(cores))

    def until(self, later: Moment) -> Occupancy | None:
        """Between the two moments; None where they are too close to tell."""
        between_s = later.clock_s - self.clock_s
        if between_s < _SHORTEST_S:
            return None
        of_all = 1 / (between_s * self.cores)
        others_s = (later.busy_s - self.busy_s) - (later.own_s - self.own_s)
        stolen_s = None if self.stolen_s is None or later.stolen_s is None else later.stolen_s - self.stolen_s
        # The clocks are not read at the very same moment.
        return Occupancy(max(others_s * of_all, 0.0), None if stolen_s is None else max(stolen_s * of_all, 0.0))


def look_around(seconds: float = _LOOK_S) -> Occupancy:
    """What uses the cores of this process for so many seconds, this process and its descendants not counted."""
    own = {os.getpid(), *(child.pid for child in psutil.Process().children(recursive=True))}
    others = [process for process in psutil.process_iter(["name"]) if process.pid not in own]
    start = Moment.now()
    for process in others:
        _cores_used(process)
    time.sleep(seconds)
    occupancy = start.until(Moment.now()) or Occupancy(0.0, None)
    used = [(str(process.info["name"]), _cores_used(process) / start.cores) for process in others]
    most = sorted(used, key=lambda user: -user[1])[:_MOST_NAMED]
    return replace(occupancy, names=tuple(user for user in most if user[1] > _LEAST_NAMED))


def _cores_used(process: psutil.Process) -> float:
    """How many cores a process has used since the last call; none where it has ended, or is not ours to look at."""
    with suppress(psutil.Error):
        return float(process.cpu_percent()) / 100
    return 0.0


@dataclass
class Waiting:
    """Waits for an idle machine, `limit_s` seconds in all; tell is called once for each wait, with what is waited for,
    and once when the time is used up."""

    limit_s: float
    tell: Callable[[str], None]
    look: Callable[[], Occupancy] = look_around
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    spent_s: float = 0.0

    def __post_init__(self) -> None:
        self.limit_s = float(os.environ.get(LIMIT_VARIABLE, self.limit_s))

    def for_idle(self) -> bool:
        """Whether the machine is idle, at once or after some waiting. False as soon as the time is used up."""
        if self.spent_s >= self.limit_s:
            return False
        start, told = self.clock(), False
        while not (busy := self.look()).is_idle:
            waited = self.spent_s + self.clock() - start
            if waited >= self.limit_s:
                self.spent_s = waited
                self.tell(f"the machine is still not idle after {waited:.0f} s: {busy}")
                return False
            if not told:
                self.tell(f"waiting for an idle machine, {self.limit_s - waited:.0f} s at most: {busy}")
                told = True
            self.sleep(_PAUSE_S)
        self.spent_s += self.clock() - start if told else 0.0
        return True

    def tell_who_disturbs(self) -> bool:
        """Look once, unless nobody is to wait, and say who uses the cores. Whether the machine is idle."""
        if self.limit_s <= 0:
            return self.for_idle()
        busy = self.look()
        if not busy.is_idle:
            self.tell(f"the machine is not idle: {busy}; measuring goes on, and the table flags what was disturbed")
        return busy.is_idle
