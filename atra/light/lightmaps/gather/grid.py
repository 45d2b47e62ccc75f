"""A grid over the scene; each cell lists which of many lights rays from there are aimed at, with probabilities.

A light's probability follows the unshadowed light it may give in the cell. Every light has a chance in every cell, so
means stay right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.gather import tables_kernels as words

SIDE = 32
"""Cells along the longest side of the scene."""

LISTED = 64
"""Most lights listed per cell; the remaining light is covered by the choice among all."""

OF_ALL = 0.1
"""Least probability of a choice among all lights, because estimates may be far off."""

_AT_ONCE = 1 << 20


class LightGrid(NamedTuple):
    """Fields of `atra.light.lightmaps.gather.tables_kernels.Tables`."""

    grid: NDArray[np.float64]
    of_all: NDArray[np.float32]
    listed: NDArray[np.int32]
    odds: NDArray[np.float32]


def uniform_grid() -> LightGrid:
    """One cell in which all lights are equally probable."""
    grid = np.array([[0.0] * 3, [0.0] * 3, [1.0] * 3])
    return LightGrid(grid, np.ones(1, np.float32), np.zeros((1, 0), np.int32), np.zeros((1, 0), np.float32))


def light_grid(rows: NDArray[np.float32], bounds: NDArray[np.floating]) -> LightGrid:
    """The grid for `light_rows` over the box `bounds`, (2, 3)."""
    low, size = bounds[0].astype(np.float64), np.ptp(bounds.astype(np.float64), axis=0)
    side = float(size.max()) / SIDE or 1.0
    count = np.maximum(1, np.ceil(size / side - 1e-9).astype(int))
    of_each = np.where(size > 0.0, size / count, side)
    radius = float(np.linalg.norm(of_each)) / 2.0
    places = np.indices(count).reshape(3, -1).T
    cells, listed = len(places), min(len(rows), LISTED)
    made = LightGrid(
        np.array([low, 1.0 / of_each, count]), np.ones(cells, np.float32), np.zeros((cells, listed), np.int32),
        np.zeros((cells, listed), np.float32),
    )  # fmt: skip
    step = max(1, _AT_ONCE // max(1, len(rows)))
    for first in range(0, cells, step):
        part = slice(first, first + step)
        given = _given(rows.astype(np.float64), low + (places[part] + 0.5) * of_each, radius)
        total = given.sum(axis=1, keepdims=True)
        shares = np.divide(given, total, out=np.zeros_like(given), where=total > 0.0)
        most = np.argsort(-shares, axis=1, kind="stable")[:, :listed]
        kept = (1.0 - OF_ALL) * np.take_along_axis(shares, most, axis=1)
        made.listed[part], made.odds[part], made.of_all[part] = most, kept, 1.0 - kept.sum(axis=1)
    return made


def _given(rows: NDArray[np.float64], centres: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """(C, L): estimated unshadowed light that each light gives within `radius` of each centre, on a surface facing
    it."""
    brightness = rows[:, words.COLOUR :] @ np.array(words.LUMINANCE, np.float64)
    kind, spread = rows[:, words.KIND], rows[:, words.SIZE]
    way = rows[:, words.PLACE : words.SIZE] - centres[:, None]
    squared = (way**2).sum(axis=2)
    given = brightness / (squared + radius**2 + spread**2)
    for light in np.flatnonzero(kind == words.SPOT):
        axis, outer = rows[light, words.ACROSS : words.UP], rows[light, words.UP + 1]
        distance = np.sqrt(squared[:, light])
        angle = np.arccos(np.clip(-way[:, light] @ axis / np.maximum(distance, 1e-300), -1.0, 1.0))
        seen_under = np.arcsin(np.minimum(1.0, radius / np.maximum(distance, 1e-300)))
        given[angle - seen_under > np.arccos(outer), light] = 0.0
    from_afar = (kind == words.SUN) | (kind == words.SKY)
    given[:, from_afar] = brightness[from_afar]
    return given
