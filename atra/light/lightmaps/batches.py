"""Batches: texels or probes that a thread takes at a time, and the memory of a bake."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from atra.light.lightmaps.sums_kernels import SUMS
from atra.rays.kernel_scene import KernelScene, Query

_TEXEL_BYTES = 2 * 8 * SUMS + 144
"""Peak memory of a texel: its sums and their means, and the arrays of `Texels` and `Lightmap`."""


def needed_bytes(texels: int) -> int:
    """Peak memory of a map of so many texels, all of them lit."""
    return texels * _TEXEL_BYTES


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
