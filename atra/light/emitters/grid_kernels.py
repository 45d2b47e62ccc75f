"""A grid over the scene; each cell lists which of many lamps rays from there are aimed at, with probabilities.

A lamp's probability follows the unshadowed light it may give in the cell. Every lamp has a chance in every cell, so
means stay right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.light import lights_kernels as words
from atra.light.numbers_kernels import ONE, ZERO

SIDE = 32
"""Cells along the longest side of the scene."""

LISTED = 64
"""Most lamps listed per cell; the others are covered by the choice among all."""

OF_ALL = 0.1
"""Least probability of a choice among all lamps, because estimates may be far off."""

_AT_ONCE = 1 << 20


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


def no_grid() -> LampGrid:
    """No cells: lamps are chosen by their power, wherever a ray starts."""
    return LampGrid(np.zeros((3, 3)), np.zeros(0, np.float32), np.zeros((0, 0), np.int32), np.zeros((0, 0), np.float32))


def lamp_grid(rows: NDArray[np.float32], brightness: NDArray[np.float64], bounds: NDArray[np.floating]) -> LampGrid:
    """The grid over the box `bounds`, (2, 3), for lamps. rows: (L, LIGHT_WORDS). brightness: (L,), luminance on a
    surface that faces them at distance 1."""
    low, size = bounds[0].astype(np.float64), np.ptp(bounds.astype(np.float64), axis=0)
    side = float(size.max()) / SIDE or 1.0
    count = np.maximum(1, np.ceil(size / side - 1e-9).astype(int))
    of_each = np.where(size > 0.0, size / count, side)
    radius = float(np.linalg.norm(of_each)) / 2.0
    places = np.indices(count).reshape(3, -1).T
    cells, listed = len(places), min(len(rows), LISTED)
    made = LampGrid(
        np.array([low, 1.0 / of_each, count]), np.ones(cells, np.float32), np.zeros((cells, listed), np.int32),
        np.zeros((cells, listed), np.float32),
    )  # fmt: skip
    step = max(1, _AT_ONCE // max(1, len(rows)))
    for first in range(0, cells, step):
        part = slice(first, first + step)
        given = _given(rows.astype(np.float64), brightness, low + (places[part] + 0.5) * of_each, radius)
        total = given.sum(axis=1, keepdims=True)
        shares = np.divide(given, total, out=np.zeros_like(given), where=total > 0.0)
        most = np.argsort(-shares, axis=1, kind="stable")[:, :listed]
        kept = (1.0 - OF_ALL) * np.take_along_axis(shares, most, axis=1)
        made.listed[part], made.odds[part], made.of_all[part] = most, kept, 1.0 - kept.sum(axis=1)
    return made


def _given(
    rows: NDArray[np.float64], brightness: NDArray[np.float64], centres: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """(C, L): estimated unshadowed light that each lamp gives within `radius` of each centre, on a surface facing
    it."""
    kind, spread = rows[:, words.KIND], rows[:, words.SIZE]
    way = rows[:, words.PLACE : words.SIZE] - centres[:, None]
    squared = (way**2).sum(axis=2)
    given = brightness / (squared + radius**2 + spread**2)
    for lamp in np.flatnonzero(kind == words.SPOT):
        axis, outer = rows[lamp, words.ACROSS : words.UP], rows[lamp, words.UP + 1]
        distance = np.sqrt(squared[:, lamp])
        angle = np.arccos(np.clip(-way[:, lamp] @ axis / np.maximum(distance, 1e-300), -1.0, 1.0))
        seen_under = np.arcsin(np.minimum(1.0, radius / np.maximum(distance, 1e-300)))
        given[angle - seen_under > np.arccos(outer), lamp] = 0.0
    from_afar = kind == words.SUN
    given[:, from_afar] = brightness[from_afar]
    return given
