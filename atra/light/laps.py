"""Laps: where the time of a picture or a map goes, stage by stage."""

from __future__ import annotations

from time import perf_counter


class Laps:
    """Seconds by stage, added to `stages`: each call ends the stage it names, and the next begins."""

    def __init__(self, stages: dict[str, float]) -> None:
        self._stages = stages
        self._start = perf_counter()

    def __call__(self, stage: str) -> None:
        now = perf_counter()
        self._stages[stage] = self._stages.get(stage, 0.0) + now - self._start
        self._start = now
