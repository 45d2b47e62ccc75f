"""Kernels that choose which light a ray after a bounce is aimed at."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO


@njit
def cell_of(tables, point):  # type: ignore[no-untyped-def]
    """The grid cell of a point; the nearest cell for points outside."""
    grid, cell = tables.grid, np.int64(0)
    if len(tables.of_all) == 1:
        return cell
    for axis in range(3):
        cells = grid[2, axis]
        place = (np.float64(point[axis]) - grid[0, axis]) * grid[1, axis]
        cell = cell * np.int64(cells) + np.int64(max(0.0, min(cells - 1.0, place)))
    return cell


@njit(error_model="numpy")
def chosen(tables, cell, number):  # type: ignore[no-untyped-def]
    """(light, its probability in this cell) for a random number in [0, 1)."""
    every = len(tables.lights)
    of_all = tables.of_all[cell]
    light = np.int64(-1)
    if number < of_all:
        light = min(every - 1, int(number / of_all * np.float32(every)))
    else:
        number -= of_all
        for place in range(tables.listed.shape[1]):
            number -= tables.odds[cell, place]
            if number < ZERO:
                light = np.int64(tables.listed[cell, place])
                break
        if light < 0:  # only by rounding
            light = np.int64(tables.listed[cell, 0])
    return light, odds_of(tables, cell, light)


@njit(error_model="numpy")
def odds_of(tables, cell, light):  # type: ignore[no-untyped-def]
    """The probability that a light is chosen in a cell."""
    odds = tables.of_all[cell] * (ONE / np.float32(len(tables.lights)))
    for place in range(tables.listed.shape[1]):
        if tables.listed[cell, place] == light:
            return odds + tables.odds[cell, place]
    return odds
