"""Packets of a block of sampled rays, counted: a block is four words, a bit a ray."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import float_part, njit

SIDE = 16
"""Pixels along the side of a block of sampled rays; a row of them is the bits of one number."""

RAYS = SIDE * SIDE

ROWS_A_WORD = 4

_SHIFT_ROW, _SHIFT_ROWS = np.uint64(SIDE), np.uint64(2 * SIDE)


@float_part
def _bits(word):  # type: ignore[no-untyped-def]
    word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit
def first_bits(width, height):  # type: ignore[no-untyped-def]
    """A word with the first bit of each packet."""
    word = np.uint64(0)
    for row in range(0, ROWS_A_WORD, min(height, ROWS_A_WORD)):
        for column in range(0, SIDE, width):
            word |= np.uint64(1) << np.uint64(SIDE * row + column)
    return word


@float_part
def _packets_that_meet(words, width, height, firsts):  # type: ignore[no-untyped-def]
    """Packets of width x height rays of which at least one bit is set. words: (4,) uint64, a bit a ray."""
    count, together = 0, max(height // ROWS_A_WORD, 1)
    for first in range(0, ROWS_A_WORD, together):
        met = words[first]
        for other in range(first + 1, first + together):
            met |= words[other]
        if height > 1:
            met |= met >> _SHIFT_ROW
        if height > 2:
            met |= met >> _SHIFT_ROWS
        step = 1
        while step < width:
            met |= met >> np.uint64(step)
            step *= 2
        count += _bits(met & firsts)
    return count


@float_part
def add_packets(masks, place, words, shapes, firsts, part, counts):  # type: ignore[no-untyped-def]
    """Add the packets of each shape in which a bit of masks[place], (SIDE,), is set to counts[:, part]."""
    any_word = np.uint64(0)
    for k in range(ROWS_A_WORD):
        word = np.uint64(0)
        for row in range(ROWS_A_WORD):
            word |= np.uint64(masks[place, ROWS_A_WORD * k + row]) << np.uint64(SIDE * row)
        words[k] = word
        any_word |= word
    if any_word:
        for kind in range(len(shapes)):
            counts[kind, part] += _packets_that_meet(words, shapes[kind, 0], shapes[kind, 1], firsts[kind])
