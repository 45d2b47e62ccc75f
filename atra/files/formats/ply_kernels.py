"""Rows of a PLY's elements that have lists."""

from __future__ import annotations

from atra.compiled.store import kernel


@kernel
def walk_rows(content, start, properties, is_big_endian, wanted, sizes, values):  # type: ignore[no-untyped-def]
    """Walk over rows of an element; the place behind them, -1 if they are not there; the length of all wanted lists;
    and the row that is broken.

    properties: (K, 3) int64; bytes of a list's length, 0 = no list, and whether it is signed; bytes of a value. wanted:
    the list whose lengths go to `sizes`, (rows,) int64, and whose bytes to `values`, (N,) uint8, or (0,) for none.
    """
    at, total = start, 0
    for row in range(len(sizes)):
        for k in range(len(properties)):
            length, count_bytes, value_bytes = 1, properties[k, 0], properties[k, 2]
            if count_bytes:
                if at + count_bytes > len(content):
                    return -1, total, row
                length = 0
                for place in range(count_bytes):
                    length = length << 8 | int(content[at + (place if is_big_endian else count_bytes - 1 - place)])
                if properties[k, 1] and count_bytes < 8 and length >> (8 * count_bytes - 1):
                    length -= 1 << (8 * count_bytes)
                at += count_bytes
            if length < 0 or length > len(content) or length * value_bytes > len(content) - at:
                return -1, total, row
            if k == wanted:
                sizes[row] = length
                for place in range(length * value_bytes if len(values) else 0):
                    values[total * value_bytes + place] = content[at + place]
                total += length
            at += length * value_bytes
    return at, total, -1
