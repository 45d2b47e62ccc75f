"""Try the promising choices within a budget of time: built in full, timed for a few frames, the slower ones dropped."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, inf

from atra.errors import MemoryBudgetError
from atra.hits import Hits
from atra.planner.choice import METHODS, Choice
from atra.planner.plan import Forecast
from atra.tracers import Tracer

Clock = Callable[[], float]

FIRST_FRAMES = 2
"""Frames of a trial before it is compared: the first, which finds caches cold, and another."""

LEAST_GAIN = 0.02
"""What another method must gain over packets by measurement; frames of one and the same tracer differ by as much."""

MOST_DEVIATIONS = 2.0
"""How many standard deviations an estimate is expected to err by at most."""

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
        self.tracer.plan()
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
        return Forecast(self.choice, self.first_s, min(self.frames_s), 0.0, measured=True)


def measure(
    estimates: Sequence[Forecast],
    packets: Choice,
    make: Callable[[Choice], Tracer],
    *,
    frames: int,
    budget_s: float,
    clock: Clock,
) -> list[Forecast]:
    """Forecasts by measurement, the one to take first, then the others by their totals; what was not tried is left out.

    estimates: of all choices. packets: the choice that others must beat, which is timed first and whatever the budget.
    make: a choice -> its tracer, neither planned nor built, with its kernels compiled.

    Others follow as their estimates rank them, as long as the budget is likely to suffice for plan, build and first
    frames: estimates are scaled by how long the last of the same method took here, or else packets. Then frames of all
    that come near the best take turns, the bound drawn tighter each round, until one is left or the budget is spent.
    """
    spent_s = 0.0
    alive: list[Trial] = []
    done: dict[Choice, Forecast] = {}
    with ExitStack() as stack:

        def best_s() -> float:
            return min(one.total_s(frames) for one in done.values())

        def drop_slower(beyond: float) -> None:
            bound_s = (1.0 + beyond) * best_s()
            for trial in [one for one in alive if one.forecast.total_s(frames) > bound_s]:
                alive.remove(trial)
                trial.close()

        def try_out(choice: Choice) -> float:
            trial = Trial(choice, make(choice))
            stack.callback(trial.close)
            begin = clock()
            trial.start(clock)
            taken_s = clock() - begin
            alive.append(trial)
            done[choice] = trial.forecast
            drop_slower(DROPPED_BEYOND[0])
            return taken_s

        spent_s += try_out(packets)
        # By method, the estimate that was last put to the test: it errs on others of its kind much as on itself.
        tested = dict.fromkeys(METHODS, next(one for one in estimates if one.choice == packets))

        def scaled_s(one: Forecast, frames: int) -> float:
            """An estimate in the seconds of this machine."""
            before = tested[one.choice.method]
            return one.total_s(frames) * done[before.choice].total_s(frames) / before.total_s(frames)

        for one in sorted(estimates, key=lambda one: one.total_s(frames)):
            # Behind the best even if the estimate errs by so much.
            hopeless = scaled_s(one, frames) * exp(-MOST_DEVIATIONS * one.error) > best_s()
            if one.choice == packets or hopeless or spent_s + scaled_s(one, FIRST_FRAMES) > budget_s:
                continue
            with suppress(MemoryBudgetError):  # which comes before anything was allocated
                spent_s += try_out(one.choice)
                tested[one.choice.method] = one
        for beyond in DROPPED_BEYOND:
            if len(alive) == 1:
                break
            for trial in alive:
                if spent_s + trial.forecast.frame_time_s <= budget_s:
                    spent_s += trial.trace(clock)
                    done[trial.choice] = trial.forecast
            drop_slower(beyond)
    ordered = sorted(done.values(), key=lambda one: one.total_s(frames))
    enough_s = (1.0 - LEAST_GAIN) * done[packets].total_s(frames)
    best = ordered[0] if ordered[0].total_s(frames) <= enough_s else done[packets]
    return [best, *(one for one in ordered if one is not best)]
