"""Interleaved timing: every method once a round, so that drift cancels in the ratio of a round."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

from atra.errors import ClockError
from experiments.harness.processes.idle import Moment, Occupancy

MINIMUM_ROUNDS = 3
"""A time budget never cuts below this many rounds: a median of fewer has no spread to show."""


@dataclass(frozen=True)
class RoundSamples:
    """Raw samples in seconds, by method; sample r of every method belongs to the same round.

    warmup: the rounds that ran before, apart from the samples.
    samples: the rounds that count, as many as `rounds`.
    occupancy: of the machine during these; None where they were too short to tell.
    """

    warmup: dict[str, tuple[float, ...]]
    samples: dict[str, tuple[float, ...]]
    occupancy: Occupancy | None = None

    @property
    def rounds(self) -> int:
        return min((len(values) for values in self.samples.values()), default=0)


def measure_rounds(
    methods: Mapping[str, Callable[[], object]],
    *,
    rounds: int,
    warmup: int,
    budget_s: float = inf,
    clock: Callable[[], float] = time.perf_counter,
) -> RoundSamples:
    """Call every method once a round, `warmup` + `rounds` times, and time each call. A call that returns a float has
    taken that many seconds: it leaves out checks of what a foreign method returned.

    The order rotates by one each round (A B C, B C A, ...), so no method always runs behind the same other.
    Once the rounds that count have spent `budget_s` seconds inside methods, no further round starts, though at least
    `MINIMUM_ROUNDS` (or `rounds`, if fewer) always run.

    Raises ClockError for a call that took no time or less.
    """
    warmup_samples: dict[str, list[float]] = {name: [] for name in methods}
    samples: dict[str, list[float]] = {name: [] for name in methods}
    for number in range(warmup):
        _run_round(methods, number, warmup_samples, clock)
    spent_s, start = 0.0, Moment.now()
    for number in range(rounds):
        if number >= MINIMUM_ROUNDS and spent_s >= budget_s:
            break
        spent_s += _run_round(methods, number, samples, clock)
    return RoundSamples(
        {name: tuple(values) for name, values in warmup_samples.items()},
        {name: tuple(values) for name, values in samples.items()},
        start.until(Moment.now()),
    )


def _run_round(
    methods: Mapping[str, Callable[[], object]],
    number: int,
    samples: dict[str, list[float]],
    clock: Callable[[], float],
) -> float:
    names = list(methods)
    first = number % len(names)
    total_s = 0.0
    for name in names[first:] + names[:first]:
        method = methods[name]
        start = clock()
        told = method()
        elapsed_s = told if isinstance(told, float) else clock() - start
        if not elapsed_s > 0:
            raise ClockError(
                f"{name} took {elapsed_s:g} s by this machine's clock, expected a positive time: the clock stood still "
                "or was set back; measure again"
            )
        samples[name].append(elapsed_s)
        total_s += elapsed_s
    return total_s
