"""Rows of a PLY's elements that have lists."""

from __future__ import annotations

from atra.compiled.store import kernel


@kernel
def walk_rows(content, start, rows, properties, is_big, wanted, sizes, begins):  # type: ignore[no-untyped-def]
    """Walk over rows of an element: the place behind them, -1 if they are not there; the length of all wanted lists;
    the row that is broken; and whether all rows are laid out as the first.

    properties: (K, 3) int64; bytes of a list's length, 0 = no list, and whether it is signed; bytes of a value. wanted:
    the list whose lengths and places go to `sizes` and `begins`, (rows,) int64 or (0,) for none.
    """
    at, total, is_alike, layout = start, 0, True, (0, 0, 0)
    for row in range(rows):
        row_start, own, begin = at, 0, 0
        for k in range(len(properties)):
            length, count_bytes = 1, properties[k, 0]
            if count_bytes:
                if at + count_bytes > len(content):
                    return -1, total, row, False
                length = 0
                for place in range(count_bytes):
                    length = length << 8 | int(content[at + (place if is_big else count_bytes - 1 - place)])
                if properties[k, 1] and count_bytes < 8 and length >> (8 * count_bytes - 1):
                    length -= 1 << (8 * count_bytes)
                at += count_bytes
            if length < 0 or length > len(content) or length * properties[k, 2] > len(content) - at:
                return -1, total, row, False
            if k == wanted:
                own, begin = length, at
            at += length * properties[k, 2]
        total += own
        if row == 0:
            layout = own, begin - row_start, at - row_start
        is_alike &= layout == (own, begin - row_start, at - row_start)
        if len(sizes):
            sizes[row], begins[row] = own, begin
    return at, total, -1, is_alike
