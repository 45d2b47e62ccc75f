"""Blocks of rays for peers that have no threads of their own, but release Python's lock while they traverse."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from experiments.methods.peers.peer import Answer, PeerScene

_BLOCKS_PER_THREAD = 8
"""Rows differ in cost; few enough that a call's own price does not show."""


Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Origins and directions, (N, 3) float32 each, world space."""


class BlockScene(PeerScene):
    """With one thread all rays go into one call. With more, the rays are cut into blocks of neighbours, each with a
    call of its own, and the threads share the blocks. `cast_block` must be written."""

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._executor = ThreadPoolExecutor(threads, "peer") if threads > 1 else None

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Rays:
        return np.ascontiguousarray(np.broadcast_to(origins, directions.shape)), directions

    def cast_block(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Answer:
        """What some of the rays hit."""
        raise NotImplementedError

    def cast(self, rays: Rays) -> Answer:
        if self._executor is None:
            return self.cast_block(*rays)
        count = min(_BLOCKS_PER_THREAD * self._threads, len(rays[1]))
        origins, directions = (np.array_split(part, count) for part in rays)
        depths, prim_ids = zip(*self._executor.map(self.cast_block, origins, directions), strict=True)
        return np.concatenate(depths), np.concatenate(prim_ids)

    def close(self) -> None:
        """End the threads."""
        if self._executor is not None:
            self._executor.shutdown()
