"""The kernel that traces batches of rays, from the BVH's root or from the lists of shafts."""

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
from experiments.classification.bvh.images import hit_of, set_ray
from experiments.classification.bvh.memory import AHEAD
from experiments.classification.bvh.packets import nearest_of_packet
from experiments.classification.bvh.single import nearest
from experiments.classification.bvh.starts import (
    ROOT_LIST,
    count_start,
    fetch_list,
    find_shafts,
    list_of,
    number_of,
    set_ahead,
)

_CHUNK = 512
_ZERO = np.float32(0.0)


class Batch(NamedTuple):
    """N rays in the order in which they are traced, and their division into packets.

    origins, directions: (N, 3) float32. tnear, tfar: (N,) float32. order: (N,) int64, ray numbers in traversal order.
    packets: (P + 1,) int64, the position in `order` where each packet starts, then N. lists: (P,) int64, where the node
    list of each packet starts (`bvh.starts.Shafts`); single rays look up their own.
    """

    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    tnear: NDArray[np.float32]
    tfar: NDArray[np.float32]
    order: NDArray[np.int64]
    packets: NDArray[np.int64]
    lists: NDArray[np.int64]


@njit(forceinline=True)
def _length_of(directions, ray):  # type: ignore[no-untyped-def]
    """(l, 1 / l), float32: the largest power of two that no component of the direction is below, all being less."""
    scale, length = scale_of(directions[ray, 0], directions[ray, 1], directions[ray, 2])
    return np.float32(length), np.float32(scale)


@njit(forceinline=True)
def _ray(batch, number):  # type: ignore[no-untyped-def]
    """Returns (ray, tfar, inverse scale). A power of two scales the direction so that its largest component is 1 to 2,
    and the interval with it; so hits do not depend on the direction's length."""
    length, inverse = _length_of(batch.directions, number)
    x, y, z = batch.origins[number, 0], batch.origins[number, 1], batch.origins[number, 2]
    dx = ray_component(batch.directions[number, 0] * inverse)
    dy = ray_component(batch.directions[number, 1] * inverse)
    dz = ray_component(batch.directions[number, 2] * inverse)
    return (x, y, z, dx, dy, dz, batch.tnear[number] * length), batch.tfar[number] * length, inverse


@njit(forceinline=True)
def _look_up(tree, batch, shafts, first, last, memory):  # type: ignore[no-untyped-def]
    """Find the node lists of the next rays and prefetch their first nodes."""
    for task in range(first, last):
        ray, _, _ = _ray(batch, batch.order[task])
        set_ahead(memory.ahead, task - first, ray)
    find_shafts(shafts.grid, memory.ahead)
    for k in range(last - first):
        start = list_of(shafts, memory.ahead, k)
        memory.starts[k] = start
        fetch_list(tree, shafts.lists, start)


@cache
def batch_kernel(
    width: int, push: bool, any_hit: bool, counting: bool, robust: bool, seeded: bool
) -> Callable[..., None]:
    """The kernel for packets of `width`. push, any_hit, counting, robust: see `bvh.single.nearest`. seeded: rays
    start from the lists of shafts."""

    @float_kernel
    def trace_batch(counter_address, tree, batch, shafts, t, prim_id, memory):  # type: ignore[no-untyped-def]
        """Trace all rays. Writes t: (N,) float32 and prim_id: (N,) uint32; a miss is inf and MISS. With any_hit, t is
        undefined."""
        stack, nears, counts, bundle = memory.stack, memory.nears, memory.counts, memory.bundle
        lists, starts = shafts.lists, memory.starts
        tasks = len(batch.order) if width == 1 else len(batch.lists)
        chunk = max(_CHUNK // width, 1)
        while True:
            start = fetch_add(counter_address, 1) * chunk
            if start >= tasks:
                return
            for task in range(start, min(start + chunk, tasks)):
                if width == 1:
                    number = batch.order[task]
                    ray, tfar, inverse = _ray(batch, number)
                    place = np.int64(ROOT_LIST)
                    if seeded:
                        if (task - start) % AHEAD == 0:
                            _look_up(tree, batch, shafts, task, min(task + AHEAD, tasks), memory)
                        place = starts[(task - start) % AHEAD]
                        if counting:
                            count_start(place, counts)
                    found, hit = nearest(
                        push, any_hit, counting, robust, tree, ray, tfar, lists, place, stack, nears, counts
                    )  # fmt: skip
                    t[number] = found * inverse if hit != MISS else INFINITY
                    prim_id[number] = hit
                    continue
                first, last = batch.packets[task], batch.packets[task + 1]
                for lane in range(width):
                    ray, tfar, inverse = _ray(batch, batch.order[min(first + lane, last - 1)])
                    is_open = first + lane < last and ray[6] < tfar
                    set_ray(bundle, lane, ray, tfar if is_open else -INFINITY)
                if seeded and counting:
                    count_start(batch.lists[task], counts)
                ways = memory.ways.ctypes.data
                nearest_of_packet(
                    width, push, any_hit, counting, robust, tree, bundle.ctypes.data, lists, batch.lists[task], stack,
                    ways, counts,
                )  # fmt: skip
                for lane in range(last - first):
                    number = batch.order[first + lane]
                    _, inverse = _length_of(batch.directions, number)
                    found, hit = hit_of(bundle, width, lane)
                    t[number] = found * inverse if hit != MISS else INFINITY
                    prim_id[number] = hit

    return trace_batch


@float_kernel
def classify(counter_address, batch, grid, numbers, ahead):  # type: ignore[no-untyped-def]
    """Write the shaft number of every ray, (N,) int64. ahead: this thread's buffer. Threads share the counter."""
    while True:
        start = fetch_add(counter_address, 1) * AHEAD
        if start >= len(numbers):
            return
        count = min(AHEAD, len(numbers) - start)
        for k in range(count):
            ray, _, _ = _ray(batch, start + k)
            set_ahead(ahead, k, ray)
        find_shafts(grid, ahead)
        for k in range(count):
            numbers[start + k] = number_of(grid, ahead, k)
