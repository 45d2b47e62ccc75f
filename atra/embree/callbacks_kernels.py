"""Compiled C functions that Embree calls: the filter and the memory monitor."""

from __future__ import annotations

from functools import cache

from numba import types

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import callback
from atra.embree.filters_kernels import keep_nearest


@cache
def nearest_hit_filter(shape_x: int, shape_y: int, instanced: bool = False) -> int:
    """Address of the filter for packets of shape_x x shape_y pixels; arguments as for `keep_nearest`."""

    @callback(types.void(types.int64))
    def keep_nearest_hit(arguments_address):  # type: ignore[no-untyped-def]
        keep_nearest(arguments_address, shape_x, shape_y, instanced)

    _keep_alive.append(keep_nearest_hit)
    return keep_nearest_hit.address


@cache
def memory_monitor() -> int:
    """Address of the memory monitor, which adds Embree's allocations to the int64 it is registered with."""

    @callback(types.boolean(types.int64, types.int64, types.boolean))
    def count_bytes(counter_address, byte_count, after):  # type: ignore[no-untyped-def]
        fetch_add(counter_address, byte_count)
        return True

    _keep_alive.append(count_bytes)
    return count_bytes.address


# Embree may call these as long as a scene lives; compiled code must never be collected.
_keep_alive: list[object] = []
