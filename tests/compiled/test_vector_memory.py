"""Vectors read from memory in other orders than they lie there, against NumPy."""

import numpy as np
import pytest
from llvmlite import ir
from numba import njit

from atra.compiled import memory
from atra.compiled.lanes import store_chosen
from atra.compiled.memory import (
    load,
    places_of,
    points_of,
    store,
    store_points,
)


@njit
def _keep_points(numbers, packed, points, rows, places):
    first, base, chosen = np.int64(numbers.ctypes.data), np.int64(points.ctypes.data), np.int64(packed.ctypes.data)
    store_points(load(first, 0.0, 8), load(first + 64, 0.0, 8), load(first + 128, 0.0, 8), base)
    target, place = np.int64(rows.ctypes.data), np.int64(places.ctypes.data)
    x, y, w = points_of(base, chosen, 1)
    store(x, target)
    store(y, target + 64)
    store(w, target + 128)
    first_x, first_y = places_of(base, chosen, 1)
    store(first_x, place)
    store(first_y, place + 32)


@njit
def _store_chosen(bits, numbers, out):
    return store_chosen(bits, np.int64(numbers.ctypes.data), np.int64(out.ctypes.data))


def test_points_are_read_by_their_distances_and_their_places_as_float32():
    numbers, chosen = np.random.default_rng(3).normal(size=(3, 8)), np.array([7, 0, 3, 3, 6, 1, 5, 2])
    packed = np.array([0xFFFF0000FFFF | int(32 * k) << 16 for k in chosen], np.uint64)
    points, rows, places = np.zeros((8, 4)), np.zeros((3, 8)), np.zeros((2, 8), np.float32)
    _keep_points(numbers, packed, points, rows, places)
    np.testing.assert_array_equal(points[:, :3], numbers.T)
    np.testing.assert_array_equal(rows, numbers[:, chosen])
    np.testing.assert_array_equal(places, numbers[:2, chosen].astype(np.float32))


@pytest.mark.parametrize("bits", [0, 1, 0b10110010, 255])
def test_chosen_numbers_are_stored_one_after_another(bits):
    numbers, out = np.arange(8, dtype=np.uint64) + np.uint64(1 << 63), np.zeros(8, np.uint64)
    count = _store_chosen(bits, numbers, out)
    chosen = numbers[[k for k in range(8) if bits >> k & 1]]
    assert count == len(chosen)
    np.testing.assert_array_equal(out[:count], chosen)


def test_without_mask_registers_lanes_are_stored_by_a_store_that_llvm_makes_no_masked_one_of(monkeypatch):
    monkeypatch.setattr(memory, "HAS_MASK_REGISTERS", False)
    kinds = ir.VectorType(ir.IntType(1), 8), ir.VectorType(ir.IntType(32), 8), ir.IntType(64)
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), kinds), "f")
    memory.store_lanes(ir.IRBuilder(function.append_basic_block()), *function.args)
    assert "store volatile <8 x i32>" in str(function)
