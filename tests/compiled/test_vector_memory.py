"""Vectors read from memory in other orders than they lie there, against NumPy."""

import numpy as np
import pytest
from numba import njit

from atra.compiled.memory import columns_of, halves, low_and_high, store


@njit
def _store_columns(table, numbers, out):
    a, b, c, d, e, f, g, h = columns_of(np.int64(table.ctypes.data), np.int64(numbers.ctypes.data))
    place = np.int64(out.ctypes.data)
    store(a, place)
    store(b, place + 64)
    store(c, place + 128)
    store(d, place + 192)
    store(e, place + 256)
    store(f, place + 320)
    store(g, place + 384)
    first, second = halves(h)
    store(first, place + 448)
    store(second, place + 480)


@njit
def _store_parts(numbers, out):
    low, high = low_and_high(np.int64(numbers.ctypes.data))
    store(low, np.int64(out.ctypes.data))
    store(high, np.int64(out.ctypes.data) + 64)


@pytest.mark.parametrize("numbers", [[5, 0, 3, 3, 99, 1, 98, 7], [42] * 8, [42] * 7 + [41]])
def test_rows_become_columns_whether_all_read_one_row_or_not(numbers):
    table, out = np.random.default_rng(1).random((100, 8)), np.zeros((8, 8))
    _store_columns(table, np.array(numbers, np.uint32), out)
    rows = table[numbers]
    np.testing.assert_array_equal(out[:7], rows.T[:7])
    of_last = np.ascontiguousarray(rows[:, 7]).view(np.float32).reshape(8, 2)
    np.testing.assert_array_equal(out[7].view(np.float32).view(np.uint32), of_last.T.ravel().view(np.uint32))


def test_both_halves_of_numbers_are_read():
    numbers, out = np.random.default_rng(2).integers(0, 1 << 32, 8, np.uint32), np.zeros((2, 8))
    _store_parts(numbers, out)
    np.testing.assert_array_equal(out, [numbers & 0xFFFF, numbers >> 16])
