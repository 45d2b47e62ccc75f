"""Rows of a PLY's elements that have lists."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit

SIGNED, UNSIGNED, FLOAT = range(3)
"""Kinds of a number."""


@njit
def _whole(content, at, size, kind, is_big):  # type: ignore[no-untyped-def]
    """The whole number at a place; -1 of a float, which is none."""
    if kind == FLOAT:
        return np.int64(-1)
    value = np.int64(0)
    for k in range(size):
        value = (value << 8) | np.int64(content[at + (k if is_big else size - 1 - k)])
    if kind == SIGNED and size < 8 and value >> (8 * size - 1):
        value -= np.int64(1) << (8 * size)
    return value


@kernel
def read_rows(content, start, properties, is_big, wanted, sizes, corners, fills):  # type: ignore[no-untyped-def]
    """Walk over rows of an element; the place behind them and the length of all wanted lists, -1 if they are not
    there, and the row where that shows.

    properties: (K, 4) int64; bytes and kind of a list's count, 0 bytes = no list; bytes and kind of the values. wanted:
    the list whose lengths go to `sizes`, (P,) int64, and if `fills` whose values go to `corners`.
    """
    at, total = start, 0
    for row in range(len(sizes)):
        for k in range(len(properties)):
            length = 1
            if properties[k, 0]:
                if at + properties[k, 0] > len(content):
                    return -1, total, row
                length = _whole(content, at, properties[k, 0], properties[k, 1], is_big)
                at += properties[k, 0]
            if length < 0 or length > (len(content) - at) // properties[k, 2]:
                return -1, total, row
            if k == wanted:
                sizes[row] = length
                for item in range(length if fills else 0):
                    place = at + item * properties[k, 2]
                    corners[total + item] = _whole(content, place, properties[k, 2], properties[k, 3], is_big)
                total += length
            at += length * properties[k, 2]
    return at, total, -1
