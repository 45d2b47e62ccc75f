"""Compiled C functions that Embree calls: the memory monitor, and what filters share, which Embree calls for every
triangle that rays of a packet hit."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import types

from atra.compiled.intrinsics import fetch_add
from atra.compiled.memory import store
from atra.compiled.store import callback, njit
from atra.compiled.vectors import splat
from atra.embree.layout import FilterArguments, RayQueryContext

VALID, USER_DATA, CONTEXT = (
    FilterArguments.valid.offset,
    FilterArguments.user_data.offset,
    FilterArguments.context.offset,
)
RAY, HIT, RAY_COUNT = FilterArguments.ray.offset, FilterArguments.hit.offset, FilterArguments.ray_count.offset
_WRONG_WIDTH = RayQueryContext.wrong_width.offset

_kept: list[object] = []


def keep_alive(function: Any) -> int:
    """The address of a compiled function, which Embree may call as long as a scene lives: it is never collected."""
    _kept.append(function)
    return int(function.address)


@njit
def refuse(context, valid, given):  # type: ignore[no-untyped-def]
    """Reject the hits of a packet of another width than was sent; `Workspace.wrong_width` then tells `given`."""
    store(splat(np.int64(given), 1), context + _WRONG_WIDTH)
    for lane in range(np.int64(given)):
        store(splat(np.int32(0), 1), valid + lane * 4)


@cache
def memory_monitor() -> int:
    """Address of the memory monitor, which adds Embree's allocations to the int64 it is registered with."""

    @callback(types.boolean(types.int64, types.int64, types.boolean))
    def count_bytes(counter_address, byte_count, after):  # type: ignore[no-untyped-def]
        fetch_add(counter_address, byte_count)
        return True

    return keep_alive(count_bytes)
