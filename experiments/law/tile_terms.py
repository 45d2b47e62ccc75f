"""The law for rays of one direction from tiles: what aligned rays, packets and single rays take to find what is lit.

Derivation: docs/model.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.law.model.counting_kernels import SIDE
from experiments.law.model.formulas import SEEN, WHOLE, above_and_below
from experiments.law.tile_looks import TileLook
from experiments.light.sun.rays import SHAPES, positions_together


class _Met(NamedTuple):
    """What a packet meets on average. upper, lower: boxes, in the levels that all tiles share and below. tested, met:
    triangles."""

    upper: float
    lower: float
    tested: float
    met: float


def _met_by(look: TileLook, across: int, down: int, part: int) -> _Met:
    kind = look.shape_of(across, down)
    upper, lower = above_and_below(look.boxes[kind, part], max(look.tiles, 1))
    return _Met(upper, lower, float(look.tested[kind, part]), float(look.met[kind, part]))


def trace_terms(look: TileLook, positions: int, width: int) -> NDArray[np.float64]:
    """Counts of aligned rays, one for each constant: packets shot, each with its shared boxes; boxes of every open
    tile's own, triangles tested and hit, for each packet; answers."""
    together = positions_together(width, positions)
    across, down = SHAPES[width // together]
    shot = float(-(-positions // together) * -(-look.size // across) * -(-look.size // down))
    one, every = _met_by(look, across, down, WHOLE), shot * look.tiles * look.open_share
    answers = float(look.tiles * look.size**2 * positions)
    return np.array([shot * (1.0 + one.upper), every * one.lower, every * one.tested, every * one.met, answers])


def prepare_terms(look: TileLook) -> NDArray[np.float64]:
    """Counts of plan and build of aligned rays: tiles, boxes that what a tile's rays sweep enters, copies."""
    swept = float(look.boxes[look.shapes.index((SIDE, SIDE)), WHOLE].sum())
    return np.array([float(look.tiles), look.tiles * swept, look.copies])


def packet_terms(look: TileLook, positions: int, width: int) -> NDArray[np.float64]:
    """Counts of packets of as many rays, positions of a texel side by side, up to their first hits: packets, boxes,
    triangles tested and hit."""
    texels = max(width // positions, 1)
    across = min(texels, look.size)
    one = _met_by(look, across, max(texels // across, 1), SEEN)
    packets = look.texels * positions / width
    return packets * np.array([1.0, one.upper + one.lower, one.tested, one.met])
