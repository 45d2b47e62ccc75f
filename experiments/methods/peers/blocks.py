"""For peers whose query runs on the calling thread: blocks of rays that Python threads share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.methods.peers.peer import RayPeerTracer

_BLOCKS_PER_THREAD = 8  # rows differ in cost; few enough that a call's own price does not show

Answer = tuple[NDArray[np.float32], NDArray[np.uint32]]


@dataclass(frozen=True, eq=False)
class RayArrays:
    """origins, directions: (N, 3) float32, world space."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]


class BlockwiseTracer(RayPeerTracer):
    """With one thread all rays go into one call. With more, the rays are cut into blocks of neighbours, each
    with a call of its own, and the threads share the blocks: the peer has no threads, but releases Python's lock while
    it traverses."""

    def __init__(self, mesh: Mesh, camera: View, threads: int | None = None) -> None:
        super().__init__(mesh, camera, threads)
        self._executor = ThreadPoolExecutor(self.threads, "peer") if self.threads > 1 else None

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> RayArrays:
        """One array of each."""
        return RayArrays(np.ascontiguousarray(np.broadcast_to(origins, directions.shape)), directions)

    def _in_blocks(self, cast: Callable[[RayArrays], Answer], rays: RayArrays) -> Answer:
        depths, prim_ids = zip(*self._each_block(cast, rays), strict=True)
        return np.concatenate(depths), np.concatenate(prim_ids)

    def _each_block(self, cast: Callable[[RayArrays], Any], rays: RayArrays) -> Iterable[Any]:
        if self._executor is None:
            return [cast(rays)]
        ends = np.linspace(0, len(rays.directions), 1 + _BLOCKS_PER_THREAD * self.threads).astype(int)
        blocks = [
            RayArrays(rays.origins[start:end], rays.directions[start:end])
            for start, end in pairwise(ends)
            if end > start
        ]
        return self._executor.map(cast, blocks)

    def close(self) -> None:
        super().close()
        if self._executor is not None:
            self._executor.shutdown()
