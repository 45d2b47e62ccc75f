"""The time a picture or a lightmap takes, stage by stage."""

from __future__ import annotations

from time import perf_counter


class Laps:
    """A stopwatch that adds seconds to `stages`: each call ends the stage it names and starts the next."""

    def __init__(self, stages: dict[str, float]) -> None:
        self._stages = stages
        self._start = perf_counter()

    def __call__(self, stage: str) -> None:
        now = perf_counter()
        self._stages[stage] = self._stages.get(stage, 0.0) + now - self._start
        self._start = now
