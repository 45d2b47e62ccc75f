"""The image that is drawn, the view that it is drawn from, and what both ways of drawing have in common."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

SPAN = 16
"""Pixels along a row over which nearness is a float32 multiple of its slope; no function of `lanes`, so that the
number of lanes changes no bit."""

NARROW = 32
"""Widest box, in pixels, of a triangle that is drawn without looking for the ends of its rows."""

GENTLE = 2.0
"""Nearness whose slope over so many pixels is at most so many times the least it has is gentle: rounding to float32
along the row changes it by few units of itself. What is steeper is computed in float64, between its corners'."""


@njit
def band_stride(width):  # type: ignore[no-untyped-def]
    """Pixels from row to row of a band in memory: a vector more than the image has, so that one may start anywhere, and
    an odd number of cache lines, so that the rows of a triangle do not all compete for the same ones."""
    return (((width + SPAN - 1) // SPAN + 1) | 1) * SPAN


class Image(NamedTuple):
    """depth, prim_id: addresses of the first pixel, 4 bytes each, rows one after another."""

    depth: int
    prim_id: int
    width: int
    height: int


class Band(NamedTuple):
    """The rows top ... bottom of the image while they are drawn, in memory of the thread that does.

    nearness, prim_id: addresses of their first pixel, 4 bytes each. stride: pixels from row to row.
    """

    nearness: int
    prim_id: int
    stride: int
    top: int
    bottom: int


class ViewOfMesh(NamedTuple):
    """vertices: (V, 3) float32. eye: (3,) float64. to_pixels: (3, 4) float64, with the samples at whole numbers."""

    vertices: NDArray[np.float32]
    eye: NDArray[np.float64]
    to_pixels: NDArray[np.float64]


class Workspace(NamedTuple):
    """Addresses of memory of one thread. band: nearness, then prim_id of a band. exact: SUMMANDS float64 of `exact`.
    first, last: float64, where each row of a triangle starts and ends, with room for whole vectors."""

    band: int
    exact: int
    first: int
    last: int
