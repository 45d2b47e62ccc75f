"""The law for rays of one direction from tiles: what aligned rays, packets and single rays take to find what is lit.

Derivation: docs/model.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.light.checks import check_whole
from atra.light.lightmaps.sun.looking import TileLook, look_at_tiles
from atra.light.lightmaps.sun.rays import SHAPES, positions_together
from atra.light.lightmaps.sun.tiles import Tiles
from atra.model.counting_kernels import SIDE
from atra.model.formulas import NANO, SEEN, WHOLE, above_and_below
from atra.tracing.options import native_packet_widths

CONSTANTS = {
    "trace": (949.0, 4.73, 51.9, 0.0, 1.42),
    "prepare": (2150.0, 14.5, 191.0),
    "packets": (36.9, 3.13, 22.0, 0.0),
    "single": (16.2, 0.919, 6.63, 0.0),
}
"""Nanoseconds by family, in the order of the terms below, measured on an Intel Xeon (Emerald Rapids, AVX-512)."""


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


@dataclass(frozen=True)
class TileForecast:
    """Predicted seconds on one thread to find which rays of a direction from tiles hit anything.

    aligned_s: plan and build included. prepare_s: these two alone. packets_s, single_s: over a BVH that is there.
    copies: of triangles for all tiles.
    """

    aligned_s: float
    prepare_s: float
    packets_s: float
    single_s: float
    copies: float

    @property
    def pays(self) -> bool:
        """Whether aligned rays are the fastest."""
        return self.aligned_s < min(self.packets_s, self.single_s)


def forecast_tiles(tiles: Tiles, direction: ArrayLike, positions: int = 16, shortcut: bool = True) -> TileForecast:
    """Predict what the rays of a direction from so many positions of each texel take, from a look at some tiles.

    shortcut: as for `look_at_tiles`. Raises InputError for fewer positions than one, and as `look_at_tiles` does.
    Source: docs/model.md.
    """
    check_whole("positions", positions, 1)
    look = look_at_tiles(tiles, direction, shortcut)
    widest = native_packet_widths()[-1]

    def seconds(name: str, terms: NDArray[np.float64]) -> float:
        return float(np.dot(CONSTANTS[name], terms)) * NANO

    prepare_s = seconds("prepare", prepare_terms(look))
    return TileForecast(
        prepare_s + seconds("trace", trace_terms(look, positions, widest)), prepare_s,
        seconds("packets", packet_terms(look, positions, widest)), seconds("single", packet_terms(look, positions, 1)),
        look.copies,
    )  # fmt: skip
