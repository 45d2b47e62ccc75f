"""Work that threads share out among themselves, batch by batch, and the time of its stages."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter

from atra.rays.kernel_scene import KernelScene, Query


class Laps:
    """A stopwatch that adds seconds to `stages`: each call ends the stage it names and starts the next."""

    def __init__(self, stages: dict[str, float]) -> None:
        self._stages = stages
        self._start = perf_counter()

    def __call__(self, stage: str) -> None:
        now = perf_counter()
        self._stages[stage] = self._stages.get(stage, 0.0) + now - self._start
        self._start = now


def in_batches(
    scene: KernelScene, starts: int, per_batch: int, add: Callable[[Query, int, int], int],
    stop: Callable[[], bool] | None = None,
) -> tuple[bool, int]:  # fmt: skip
    """Call `add(query, first, count)` in all threads until all `starts` entries had their turn, `per_batch` at a time.

    add: returns the rays that it traced. stop: asked before every batch. Returns whether it finished, and all rays.
    """
    left = deque(range(0, starts, per_batch))  # `popleft` is thread-safe
    rays = [0] * scene.threads

    def work(query: Query) -> None:
        while stop is None or not stop():
            try:
                first = left.popleft()
            except IndexError:
                return
            rays[query.worker] += add(query, first, min(per_batch, starts - first))

    scene.run(work)
    return not left, sum(rays)
