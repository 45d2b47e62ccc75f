"""Verdicts of pixels as a picture with marks that are seen among a million pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.judge.compare import Verdict

COLOURS: dict[Verdict, tuple[int, int, int]] = {
    Verdict.TIED: (0, 114, 178),
    Verdict.EDGE: (230, 159, 0),
    Verdict.WRONG: (213, 0, 50),
}
"""RGB of the marks; blue and orange are Okabe and Ito's. Shapes tell them apart, too: tied is a square, edge a
diamond, wrong a larger cross."""


def mark_verdicts(verdict: NDArray[np.uint8], reach_pixels: int | None = None) -> NDArray[np.uint8]:
    """The marks of (H, W) codes of `Verdict` on white: (H, W, 3) uint8 RGB.

    reach_pixels: how far a mark reaches beyond its pixel; 0 marks the pixels alone, None chooses by the image's size.
    Where marks overlap, the graver verdict is on top.
    """
    shape = verdict.shape
    reach = max(1, round(max(shape) / 150)) if reach_pixels is None else reach_pixels
    picture = np.full((*shape, 3), 255, np.uint8)
    for kind, colour in COLOURS.items():
        y, x = np.nonzero(verdict == kind)
        for dy, dx in _mark(kind, reach):
            inside = (y + dy >= 0) & (y + dy < shape[0]) & (x + dx >= 0) & (x + dx < shape[1])
            picture[y[inside] + dy, x[inside] + dx] = colour
    return picture


def _mark(kind: Verdict, reach: int) -> list[tuple[int, int]]:
    """Offsets (dy, dx) of a mark's pixels; its own pixel is among them."""
    if kind is Verdict.WRONG:
        arm, half = 2 * reach, reach // 3
        near = [(dy, dx) for dy in range(-arm, arm + 1) for dx in range(-arm, arm + 1)]
        return [(dy, dx) for dy, dx in near if abs(abs(dy) - abs(dx)) <= half]
    square = [(dy, dx) for dy in range(-reach, reach + 1) for dx in range(-reach, reach + 1)]
    if kind is Verdict.EDGE:
        return [(dy, dx) for dy, dx in square if abs(dy) + abs(dx) <= reach]
    half = reach - reach // 4  # as large to the eye as the diamond
    return [(dy, dx) for dy, dx in square if max(abs(dy), abs(dx)) <= half]
