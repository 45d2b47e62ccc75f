"""Memory of one thread that traverses: a stack, a bundle of rays, and what is counted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.kernels.bvh.layout import STACK
from atra.kernels.bvh.packets import ROWS
from atra.kernels.bvh.single import COUNTS

LONGEST_LIST = 255
"""Nodes that a traversal may start from."""


class Memory(NamedTuple):
    """stack: (S,) int64, nodes to come. nears: (S,) float32, where a single ray enters each of them. ways: (S, width)
    float32, where the rays of a packet do. bundle: (ROWS, width) float32. counts: (COUNTS,) int64, added to."""

    stack: NDArray[np.int64]
    nears: NDArray[np.float32]
    ways: NDArray[np.float32]
    bundle: NDArray[np.float32]
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, width: int) -> Memory:
        """For packets of `width`."""
        room = STACK + LONGEST_LIST
        return cls(
            np.empty(room, np.int64),
            np.empty(room, np.float32),
            np.empty((room, width), np.float32),
            np.zeros((ROWS, width), np.float32),
            np.zeros(COUNTS, np.int64),
        )
