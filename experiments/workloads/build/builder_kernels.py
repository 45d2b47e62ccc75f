"""Compiled C functions that Embree's BVH builder calls."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from atra.compiled.intrinsics import address_at, emitting, float_at, pointer_at
from atra.compiled.store import callback, njit

COST_WORDS = 2
"""Sums, float64, that the builder's callbacks add to: half the areas of all children, and of leaves times triangles."""


@intrinsic
def _add_at(typingctx: Any, address: Any, value: Any) -> Any:
    """Add to the float64 at an address, atomically."""

    def emit(builder: ir.IRBuilder, address: ir.Value, value: ir.Value) -> None:
        builder.atomic_rmw("fadd", pointer_at(builder, address, ir.DoubleType().as_pointer()), value, "monotonic")

    return types.void(types.int64, types.float64), emitting(emit)


@njit(forceinline=True)
def _half_area(low_x, low_y, low_z, high_x, high_y, high_z):  # type: ignore[no-untyped-def]
    x, y, z = np.float64(high_x) - low_x, np.float64(high_y) - low_y, np.float64(high_z) - low_z
    return x * y + y * z + z * x


@cache
def builder_callbacks() -> tuple[int, int, int, int]:
    """Addresses of RTCCreateNode, RTCSetNodeChildren, RTCSetNodeBounds and RTCCreateLeaf functions."""

    @callback(types.int64(types.int64, types.uint32, types.int64))
    def create_node(allocator, child_count, cost):  # type: ignore[no-untyped-def]
        return cost  # any address but 0 will do

    @callback(types.void(types.int64, types.int64, types.uint32, types.int64))
    def set_node_children(node, children, child_count, cost):  # type: ignore[no-untyped-def]
        pass

    @callback(types.void(types.int64, types.int64, types.uint32, types.int64))
    def set_node_bounds(node, bounds, child_count, cost):  # type: ignore[no-untyped-def]
        for child in range(child_count):
            box = address_at(bounds + 8 * child)
            area = _half_area(
                float_at(box), float_at(box + 4), float_at(box + 8),
                float_at(box + 16), float_at(box + 20), float_at(box + 24),
            )  # fmt: skip
            _add_at(cost, area)

    @callback(types.int64(types.int64, types.int64, types.uint64, types.int64))
    def create_leaf(allocator, primitives, count, cost):  # type: ignore[no-untyped-def]
        low_x = low_y = low_z = np.float32(np.inf)
        high_x = high_y = high_z = np.float32(-np.inf)
        for number in range(count):
            box = primitives + 32 * np.int64(number)
            low_x, high_x = min(low_x, float_at(box)), max(high_x, float_at(box + 16))
            low_y, high_y = min(low_y, float_at(box + 4)), max(high_y, float_at(box + 20))
            low_z, high_z = min(low_z, float_at(box + 8)), max(high_z, float_at(box + 24))
        _add_at(cost + 8, count * _half_area(low_x, low_y, low_z, high_x, high_y, high_z))
        return cost

    functions = (create_node, set_node_children, set_node_bounds, create_leaf)
    _keep_alive.extend(functions)
    addresses = [function.address for function in functions]
    return addresses[0], addresses[1], addresses[2], addresses[3]


# The builder calls these after this module is done with them; compiled code must never be collected.
_keep_alive: list[object] = []
