"""Kernels that choose which of many lamps a ray is aimed at, by the grid's cell that it starts in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO


class LampGrid(NamedTuple):
    """C cells, each with K listed lamps; 0 cells: there is no grid.

    box: (3, 3) float64, its lower corner, cells per unit, and numbers of cells. of_all: (C,) float32, probability that
    a cell chooses among all lamps. listed: (C, K) int32. odds: (C, K) float32, probabilities of these, which add up to
    1 with of_all.
    """

    box: NDArray[np.float64]
    of_all: NDArray[np.float32]
    listed: NDArray[np.int32]
    odds: NDArray[np.float32]


@njit
def cell_of(grid, point):  # type: ignore[no-untyped-def]
    """The cell of a point; the nearest cell for points outside."""
    box, cell = grid.box, np.int64(0)
    for axis in range(3):
        cells = box[2, axis]
        place = (np.float64(point[axis]) - box[0, axis]) * box[1, axis]
        cell = cell * np.int64(cells) + np.int64(max(0.0, min(cells - 1.0, place)))
    return cell


@njit(error_model="numpy")
def chosen_in(grid, lamps, cell, number):  # type: ignore[no-untyped-def]
    """(lamp, its probability in this cell) for a random number in [0, 1). lamps: how many there are."""
    of_all, lamp = grid.of_all[cell], np.int64(-1)
    if number < of_all:
        lamp = min(lamps - 1, np.int64(number / of_all * np.float32(lamps)))
    else:
        number -= of_all
        for place in range(grid.listed.shape[1]):
            number -= grid.odds[cell, place]
            if number < ZERO:
                lamp = np.int64(grid.listed[cell, place])
                break
        if lamp < 0:  # only by rounding
            lamp = np.int64(grid.listed[cell, 0])
    odds = of_all * (ONE / np.float32(lamps))
    for place in range(grid.listed.shape[1]):
        if grid.listed[cell, place] == lamp:
            return lamp, odds + grid.odds[cell, place]
    return lamp, odds
