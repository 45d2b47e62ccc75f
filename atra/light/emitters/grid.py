"""A grid over the scene; each cell lists which of many lamps rays from there are aimed at, with probabilities.

A lamp's probability follows the unshadowed light it may give in the cell. Every lamp has a chance in every cell, so
means stay right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light import lights_kernels as words
from atra.light.emitters.grid_kernels import LampGrid

SIDE = 32
"""Cells along the longest side of the scene."""

LISTED = 64
"""Most lamps listed per cell; the others are covered by the choice among all."""

OF_ALL = 0.1
"""Least probability of a choice among all lamps, because estimates may be far off."""

_AT_ONCE = 1 << 20


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
