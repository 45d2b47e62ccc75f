"""Kernels that trace and classify batches of rays, from the BVH's root or from the lists of shafts."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY, MISS, ray_component
from atra.rays.rays_kernels import scale_of
from experiments.classification.bvh.binary import STACK
from experiments.classification.bvh.single import COUNTS, nearest
from experiments.classification.bvh.starts import (
    AHEAD,
    AHEAD_ROWS,
    ROOT_LIST,
    count_start,
    fetch_list,
    find_shafts,
    list_of,
    number_of,
    set_ahead,
)

_CHUNK = 512


class Batch(NamedTuple):
    """N rays. origins, directions: (N, 3) float32. tnear, tfar: (N,) float32. order: (N,) int64, ray numbers in
    traversal order."""

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    tnear: NDArray[np.float32]
    tfar: NDArray[np.float32]
    order: NDArray[np.int64]


def batch_of(
    origins: NDArray, directions: NDArray, tnear: NDArray, tfar: NDArray, order: NDArray | None = None
) -> Batch:
    """Rays of any precision as kernels read them. order: None keeps the given one."""
    with np.errstate(over="ignore", under="ignore"):
        arrays = [np.ascontiguousarray(one, np.float32) for one in (origins, directions, tnear, tfar)]
    for one in arrays:
        one.setflags(write=False)  # kernels are compiled for such arrays
    return Batch(arrays[0], arrays[1], arrays[2], arrays[3], np.arange(len(origins)) if order is None else order)


class Memory(NamedTuple):
    """Working memory of one thread.

    stack: (STACK,) int64, nodes to visit. nears: (STACK,) float32, where a ray enters them. ahead: (AHEAD_ROWS, AHEAD)
    float32, the next rays and their shafts. starts: (AHEAD,) int64, where their lists start. counts: (COUNTS,) int64,
    counters that kernels add to.
    """

    stack: NDArray[np.int64]
    nears: NDArray[np.float32]
    ahead: NDArray[np.float32]
    starts: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def new(cls) -> Memory:
        stack, nears, counts = np.empty(STACK, np.int64), np.empty(STACK, np.float32), np.zeros(COUNTS, np.int64)
        return cls(stack, nears, np.zeros((AHEAD_ROWS, AHEAD), np.float32), np.zeros(AHEAD, np.int64), counts)


@njit(forceinline=True)
def _ray(batch, number):  # type: ignore[no-untyped-def]
    """Returns (ray, tfar, inverse scale). A power of two scales the direction so that its largest component is 1 to 2,
    and the interval with it; so hits do not depend on the direction's length."""
    dx, dy, dz = batch.directions[number, 0], batch.directions[number, 1], batch.directions[number, 2]
    scale, length = scale_of(dx, dy, dz)
    length, inverse = np.float32(length), np.float32(scale)
    x, y, z = batch.origins[number, 0], batch.origins[number, 1], batch.origins[number, 2]
    dx, dy, dz = ray_component(dx * inverse), ray_component(dy * inverse), ray_component(dz * inverse)
    return (x, y, z, dx, dy, dz, batch.tnear[number] * length), batch.tfar[number] * length, inverse


@njit(forceinline=True)
def _look_up(tree, batch, shafts, first, last, memory):  # type: ignore[no-untyped-def]
    """Find the node lists of the next rays and prefetch their first nodes."""
    for place in range(first, last):
        ray, _, _ = _ray(batch, batch.order[place])
        set_ahead(memory.ahead, place - first, ray)
    find_shafts(shafts.grid, memory.ahead)
    for k in range(last - first):
        start = list_of(shafts, memory.ahead, k)
        memory.starts[k] = start
        fetch_list(tree, shafts.lists, start)


@cache
def batch_kernel(push: bool, any_hit: bool, counting: bool, seeded: bool) -> Callable[..., None]:
    """The kernel that traces a batch. push, any_hit, counting: see `bvh.single.nearest`. seeded: rays start from the
    lists of shafts."""

    @float_kernel
    def trace_batch(counter_address, tree, batch, shafts, t, prim_id, memory):  # type: ignore[no-untyped-def]
        """Trace all rays. Writes t: (N,) float32 and prim_id: (N,) uint32; a miss is inf and MISS. With any_hit, t is
        undefined."""
        stack, nears, counts, lists = memory.stack, memory.nears, memory.counts, shafts.lists
        rays = len(batch.order)
        while True:
            start = fetch_add(counter_address, 1) * _CHUNK
            if start >= rays:
                return
            for place in range(start, min(start + _CHUNK, rays)):
                number = batch.order[place]
                ray, tfar, inverse = _ray(batch, number)
                first = np.int64(ROOT_LIST)
                if seeded:
                    if (place - start) % AHEAD == 0:
                        _look_up(tree, batch, shafts, place, min(place + AHEAD, rays), memory)
                    first = memory.starts[(place - start) % AHEAD]
                    if counting:
                        count_start(first, counts)
                found, hit = nearest(push, any_hit, counting, tree, ray, tfar, lists, first, stack, nears, counts)
                t[number] = found * inverse if hit != MISS else INFINITY
                prim_id[number] = hit

    return trace_batch


@float_kernel
def classify(counter_address, batch, step, grid, numbers, ahead):  # type: ignore[no-untyped-def]
    """Write the shaft number of every step-th ray, (N,) int64. ahead: buffer of this thread, as in `Memory`. Threads
    share the counter."""
    while True:
        start = fetch_add(counter_address, 1) * AHEAD
        if start >= len(numbers):
            return
        count = min(AHEAD, len(numbers) - start)
        for k in range(count):
            ray, _, _ = _ray(batch, (start + k) * step)
            set_ahead(ahead, k, ray)
        find_shafts(grid, ahead)
        for k in range(count):
            numbers[start + k] = number_of(grid, ahead, k)
