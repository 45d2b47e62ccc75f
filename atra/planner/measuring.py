"""Trials of choices within a budget of time: built in full, timed for a few frames, the slower ones dropped."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise
from math import inf

from atra.errors import MemoryBudgetError
from atra.hits import Hits
from atra.planner.choice import RASTER, Choice
from atra.planner.plan import Forecast
from atra.tracing.tracer import Tracer

Clock = Callable[[], float]

FIRST_FRAMES = 2
"""Frames of a trial before it is compared: the first, which finds caches cold, and another."""

LEAST_GAIN = 0.02
"""What another method must gain over the first by measurement; frames of one and the same tracer differ by as much."""

HOPED_GAIN = 0.25
"""Share of all frames' time that another choice is hoped to save: a trial that is likely to take longer cannot pay."""

SURELY_SLOWER = 0.1
"""How much a method may lose from wider cells to narrower ones before even narrower ones are left out."""

MORE_COPIES = 2.0
"""How many times as long a trial may take as that of the next wider cells: halved, they keep at most about twice the
copies.
For the widest cells of a method, a guess: as many times as long as the longest trial without cells."""

BUILDING = 2.0
"""How many times as long as a trial that builds no BVH one that does may take, at least: often 6 to 10 times."""

HIGH_QUALITY_FRAMES, HIGH_QUALITY_COST = 1000, 40.0
"""From so many frames on a slow build may pay, which takes Embree 3 to 40 times as long and saves up to a tenth of a
frame."""

DROPPED_BEYOND = (0.3, 0.2, 0.1, 0.05, 0.03, 0.02)
"""Round by round, how much slower than the best a trial may be to stay; those left after the last are as good."""

LONGEST_STEP_S = 1e-4
"""By how much a clock may move at a time; one that moves by more cannot tell frames of a few milliseconds apart."""

_READINGS = 1000


def clock_for(threads: int) -> Clock:
    """Processor time of the calling thread for one thread, so that what other processes do does not count; else, and
    where processor time moves in long steps, the wall clock.

    The step is looked for in readings of the clock: Windows counts ticks of 15.6 ms, for which Python says 1e-7 s.
    """
    if threads > 1:
        return time.perf_counter
    readings = [time.thread_time() for _ in range(_READINGS)]
    step_s = min((after - before for before, after in pairwise(readings) if after > before), default=inf)
    return time.thread_time if step_s <= LONGEST_STEP_S else time.perf_counter


@dataclass
class Trial:
    """A choice under measurement. frames_s: all frames but the first, which went into first_s."""

    choice: Choice
    tracer: Tracer
    first_s: float = 0.0
    frames_s: list[float] = field(default_factory=list)
    _image: Hits | None = None

    def start(self, clock: Clock) -> None:
        """Plan, build and trace the first frames. Raises MemoryBudgetError as the tracer does."""
        begin = clock()
        self.tracer.build()
        self._image = self.tracer.trace()
        self.first_s = clock() - begin
        for _ in range(FIRST_FRAMES - 1):
            self.trace(clock)

    def trace(self, clock: Clock) -> float:
        begin = clock()
        self._image = self.tracer.trace(out=self._image)
        self.frames_s.append(clock() - begin)
        return self.frames_s[-1]

    def close(self) -> None:
        self.tracer.close()
        self._image = None

    @property
    def forecast(self) -> Forecast:
        # Whatever disturbs a frame makes it longer, so the shortest is the best guess.
        return Forecast(self.choice, self.first_s, min(self.frames_s))


def measure(
    choices: Sequence[Choice], make: Callable[[Choice], Tracer], *, frames: int, budget_s: float, clock: Clock
) -> list[Forecast]:
    """What was tried, the one to take first, then the others by their totals.

    choices: the one that others must beat first, which is tried whatever the budget; then method by method, the widest
    cells of each first. make: a choice -> its tracer, neither planned nor built, with its kernels compiled.

    A method's narrower cells follow as long as plan, build and first frames are likely to fit into the budget and the
    memory and to cost less than they may save, and until they are surely slower. From `HIGH_QUALITY_FRAMES` on the best
    is tried with a slow build, too. Then frames of all that come near the best take turns, the bound drawn tighter each
    round, until one is left or the budget is spent.
    """
    spent_s = 0.0
    alive: list[Trial] = []
    done: dict[Choice, Forecast] = {}
    with ExitStack() as stack:

        def total_s(forecast: Forecast) -> float:
            return forecast.total_s(frames)

        def drop_slower(beyond: float) -> None:
            bound_s = (1.0 + beyond) * min(map(total_s, done.values()))
            for trial in [one for one in alive if total_s(one.forecast) > bound_s]:
                alive.remove(trial)
                trial.close()

        def try_out(choice: Choice) -> float:
            """Seconds that the trial took; they are spent even where it ends in a MemoryBudgetError."""
            nonlocal spent_s
            trial = Trial(choice, make(choice))
            stack.callback(trial.close)
            begin = clock()
            try:
                trial.start(clock)
            finally:
                taken_s = clock() - begin
                spent_s += taken_s
            alive.append(trial)
            done[choice] = trial.forecast
            drop_slower(DROPPED_BEYOND[0])
            return taken_s

        def pays(expected_s: float) -> bool:
            return expected_s <= min(budget_s - spent_s, HOPED_GAIN * min(map(total_s, done.values())))

        longest_s = try_out(choices[0]) * (BUILDING if choices[0].method == RASTER else 1.0)
        for _, of_method in groupby(choices[1:], lambda choice: choice.method):
            taken_s, shortest_s = longest_s, inf
            for choice in of_method:
                if not pays(MORE_COPIES * taken_s):
                    break
                try:
                    taken_s = try_out(choice)
                except MemoryBudgetError:  # raised before anything is allocated; narrower cells need more
                    break
                if total_s(done[choice]) > (1.0 + SURELY_SLOWER) * shortest_s:
                    break
                shortest_s = min(shortest_s, total_s(done[choice]))
                if choice.split == (1, 1):
                    longest_s = max(longest_s, taken_s)
        best = min(done.values(), key=total_s)
        builds = best.choice.method != RASTER
        if frames >= HIGH_QUALITY_FRAMES and builds and spent_s + HIGH_QUALITY_COST * best.first_s <= budget_s:
            with suppress(MemoryBudgetError):
                try_out(replace(best.choice, build_quality="high"))
        for beyond in DROPPED_BEYOND:
            if len(alive) == 1:
                break
            for trial in alive:
                if spent_s + trial.forecast.frame_time_s <= budget_s:
                    spent_s += trial.trace(clock)
                    done[trial.choice] = trial.forecast
            drop_slower(beyond)
    ordered = sorted(done.values(), key=total_s)
    first = done[choices[0]]
    best = ordered[0] if total_s(ordered[0]) <= (1.0 - LEAST_GAIN) * total_s(first) else first
    return [best, *(one for one in ordered if one is not best)]
