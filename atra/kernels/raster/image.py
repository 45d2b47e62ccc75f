"""The image that is drawn, the view that it is drawn from, and what both ways of drawing have in common."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SPAN = 16
"""Pixels along a row over which nearness is a float32 multiple of its slope; no function of `lanes`, so that the
number of lanes changes no bit."""

GENTLE = 2.0
"""Nearness whose slope over SPAN pixels is at most so many times the least it has is gentle: rounding to float32 along
the row changes it by few units of itself. What is steeper is computed in float64 and kept within its corners'."""


class ImageInMemory(NamedTuple):
    """nearness, prim_id: addresses of the first pixel, 4 bytes each. stride: pixels from row to row, whole vectors."""

    nearness: int
    prim_id: int
    width: int
    height: int
    stride: int


class ViewOfMesh(NamedTuple):
    """vertices: (V, 3) float32. eye: (3,) float64. to_pixels: (3, 4) float64, with the samples at whole numbers."""

    vertices: NDArray[np.float32]
    eye: NDArray[np.float64]
    to_pixels: NDArray[np.float64]
