"""Memory of one thread that traverses: a stack, a bundle of rays, and what is counted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.bvh.layout import STACK
from atra.bvh.packets import ROWS
from atra.bvh.single import COUNTS

AHEAD = 16
"""Rays whose lists are looked up before they are traced: so one need not wait for the memory of another."""


class Memory(NamedTuple):
    """stack: (S,) int64, nodes to come. nears: (S,) float32, where a single ray enters each of them. ways: (S, width)
    float32, where the rays of a packet do. bundle: (ROWS, width) float32. ahead: (8, AHEAD) float32, rays to come and
    their shafts, and starts: (AHEAD,) int64, where their lists begin. counts: (COUNTS,) int64, added to."""

    stack: NDArray[np.int64]
    nears: NDArray[np.float32]
    ways: NDArray[np.float32]
    bundle: NDArray[np.float32]
    ahead: NDArray[np.float32]
    starts: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def of(cls, width: int) -> Memory:
        """For packets of `width`."""
        return cls(
            np.empty(STACK, np.int64),
            np.empty(STACK, np.float32),
            np.empty((STACK, width), np.float32),
            np.zeros((ROWS, width), np.float32),
            np.zeros((8, AHEAD), np.float32),
            np.zeros(AHEAD, np.int64),
            np.zeros(COUNTS, np.int64),
        )
