"""The target: what is gathered into, and which hits near an edge are not to be taken, as one block of addresses.

A filter is handed nothing but an address, so this block is read from memory there; loops in Numba read it alike.
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
"""Ends the list of a pixel's triangles in doubt; no triangle has this number."""

LINE = 16
"""Pixels of a cache line, which are as many as the widest vector has."""

MARKS = 8
"""Bits of a pixel's mark: that of triangle t is bit t modulo MARKS."""


class Target(NamedTuple):
    """What hits are gathered into.

    values: address of the first pixel of counts, thickness, transmittance, or depth of the first layer; prim_ids and
    counts: of the first layer's triangles and of the counts beside layers. row, plane: pixels from one row, and layer,
    to the next. layers: their number. weights: address of (F,) float32.
    marks: address of a byte for each pixel, with the bits of the triangles in doubt there; first: of an int32 for each
    pixel, where its list in `listed` begins, (N,) uint32; read only where a mark is set.
    is_known: 1 where the image is an earlier one, so that layers beyond its counts hold none already.
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
    """Of these lanes, bit by bit, those in whose pixel's list the triangle is."""
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
def without_doubts(lanes, nx, taken, prim_id, pixel, target):  # type: ignore[no-untyped-def]
    """Of a mask of `lanes` pixels, in rows of nx, those where the triangle is not in doubt. pixel: the first."""
    mark = 1 << np.int64(prim_id % np.uint32(MARKS))
    marked = taken & marked_rows(target.marks + pixel, target.row, mark, lanes, nx)
    bits = bits_of(marked)
    if rarely(bits != 0):
        taken = taken & mask_of(~_listed(bits, nx, prim_id, pixel, target), lanes)
    return taken


@njit
def band_stride(width):  # type: ignore[no-untyped-def]
    """Pixels from row to row, in memory, of an image that hits are gathered or drawn into: a vector more than the image
    has, so that one may start anywhere, and an odd number of cache lines, so that the rows of a triangle do not all
    compete for the same ones."""
    return (((width + LINE - 1) // LINE + 1) | 1) * LINE
