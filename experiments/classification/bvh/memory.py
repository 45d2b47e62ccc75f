"""The working memory of a traversal thread."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.classification.bvh.binary import STACK
from experiments.classification.bvh.packets import ROWS
from experiments.classification.bvh.single import COUNTS

AHEAD = 16
"""Rays whose shafts are looked up together, before they are traced; this hides memory latency."""


class Memory(NamedTuple):
    """Working memory of one thread, for packets of `width`.

    stack: (S,) int64, nodes to visit. nears: (S,) float32, where a single ray enters them. ways: (S, width) float32,
    where the rays of a packet do. bundle: (ROWS, width) float32. ahead: (8, AHEAD) float32, the next rays and their
    shafts. starts: (AHEAD,) int64, where their lists start. counts: (COUNTS,) int64, counters that kernels add to.
    """

    stack: NDArray[np.int64]
    nears: NDArray[np.float32]
    ways: NDArray[np.float32]
    bundle: NDArray[np.float32]
    ahead: NDArray[np.float32]
    starts: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, width: int) -> Memory:
        return cls(
            np.empty(STACK, np.int64),
            np.empty(STACK, np.float32),
            np.empty((STACK, width), np.float32),
            np.zeros((ROWS, width), np.float32),
            np.zeros((8, AHEAD), np.float32),
            np.zeros(AHEAD, np.int64),
            np.zeros(COUNTS, np.int64),
        )
