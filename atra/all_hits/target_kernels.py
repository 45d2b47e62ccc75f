"""The target: the arrays that hits are gathered into, and the undecided hits to leave out, as one block of addresses.

A filter receives nothing but an address, so it reads the block from memory; Numba loops read it likewise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import address_at, int32_at, uint32_at
from atra.compiled.lanes import marked_rows
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, mask_of, rarely

LIST_END = np.uint32(0xFFFFFFFF)
"""Ends a pixel's list of undecided triangles; no triangle has this number."""

LINE = 16
"""Pixels of a cache line; also the widest vector."""

MARKS = 8
"""Bits of a pixel's mark; triangle t sets bit t modulo MARKS."""


class Target(NamedTuple):
    """Where hits are gathered; all fields but numbers are addresses.

    values: first pixel of counts, thicknesses, transmittances, or depths of the first layer. prim_ids, counts: of the
    first layer, and of the counts beside layers. row, plane: pixels from one row, and layer, to the next. layers:
    number of layers. weights: (F,) float32. marks: one byte per pixel, the marks of its undecided triangles. first: one
    int32 per pixel, where its list starts in `listed`, (N,) uint32; valid only where a mark is set. is_known: 1 for an
    earlier result, whose layers beyond its counts are known to be misses.
    """

    values: int
    prim_ids: int
    counts: int
    row: int
    plane: int
    layers: int
    weights: int
    marks: int
    first: int
    listed: int
    is_known: int

    def block(self) -> NDArray[np.int64]:
        """The block of addresses that `target_at` reads."""
        return np.array(self, np.int64)


@njit(forceinline=True)
def target_at(block):  # type: ignore[no-untyped-def]
    """The `Target` at an address."""
    return Target(
        address_at(block), address_at(block + 8), address_at(block + 16), address_at(block + 24),
        address_at(block + 32), address_at(block + 40), address_at(block + 48), address_at(block + 56),
        address_at(block + 64), address_at(block + 72), address_at(block + 80),
    )  # fmt: skip


@njit
def _listed(marked, nx, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Bits of those lanes whose pixel lists the triangle."""
    found, left, lane = 0, marked, 0
    while left != 0:
        if left & 1:
            at = pixel + lane // nx * target.row + lane % nx
            place = target.listed + np.int64(int32_at(target.first + at * 4)) * 4
            listed = uint32_at(place)
            while listed != LIST_END:
                if listed == prim_id:
                    found |= 1 << lane
                place += 4
                listed = uint32_at(place)
        left >>= 1
        lane += 1
    return found


@njit(forceinline=True)
def without_undecided(lanes, nx, taken, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Mask `taken` without the pixels where the triangle is undecided: `lanes` pixels in rows of nx, the first is
    `pixel`."""
    mark = 1 << np.int64(prim_id % np.uint32(MARKS))
    marked = taken & marked_rows(target.marks + pixel, target.row, mark, lanes, nx)
    bits = bits_of(marked)
    if rarely(bits != 0):
        taken = taken & mask_of(~_listed(bits, nx, prim_id, pixel, target), lanes)
    return taken


@njit
def band_stride(width):  # type: ignore[no-untyped-def]
    """Pixels from row to row of an image that hits are gathered or drawn into. There is room for an extra vector, so
    one may start anywhere. The number of cache lines is odd, so rows do not compete for the same cache sets."""
    return (((width + LINE - 1) // LINE + 1) | 1) * LINE
