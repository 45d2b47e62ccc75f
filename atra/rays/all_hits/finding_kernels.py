"""The loops over batches of rays for all their hits: finding, sorting and counting them, and laying them out."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import fetch_add, int32_at, uint32_at
from atra.compiled.lanes import first_bit
from atra.compiled.store import float_kernel, kernel, njit
from atra.exact.lines_kernels import plane_parameter
from atra.exact.sums_kernels import out_of_line
from atra.rays.all_hits.boxes_kernels import box_ray, child_node, entered, first_block, start_of
from atra.rays.all_hits.crossings_kernels import candidates, crossing_of, line_of, prim_id_of
from atra.rays.all_hits.groups_kernels import GROUP, find_together
from atra.rays.all_hits.memory import CHUNK, LEAVES, WORKER_SHIFT, TreeAddresses
from atra.rays.rays_kernels import scaled_ray, vector_at
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS, CHILDREN

_GAPS = (701, 301, 132, 57, 23, 10, 4, 1)
"""Steps of a Shell sort. Source: M. Ciura, "Best increments for the average case of Shellsort", 2001."""


class Close(NamedTuple):
    """What decides the order of hits of one ray that are close to each other.

    gap: largest difference of two t that leaves their order undecided: the errors of both. o, d, scale: of
    `scaled_ray`. tree, exact: as elsewhere.
    """

    gap: float
    o: tuple[float, float, float]
    d: tuple[float, float, float]
    scale: float
    tree: TreeAddresses
    exact: int


@out_of_line
def _settled(close, prim_id):  # type: ignore[no-untyped-def]
    """t of a hit, right to a unit."""
    face = close.tree.faces + 12 * np.int64(prim_id)
    a = vector_at(close.tree.vertices + 12 * np.int64(uint32_at(face)), False)
    b = vector_at(close.tree.vertices + 12 * np.int64(uint32_at(face + 4)), False)
    c = vector_at(close.tree.vertices + 12 * np.int64(uint32_at(face + 8)), False)
    return plane_parameter(close.o, close.d, a, b, c, close.exact) * close.scale


@out_of_line
def _sort(found, first, count):  # type: ignore[no-untyped-def]
    """Sort hits by t, and by prim_id where it is the same."""
    for gap in _GAPS:
        if gap >= count:
            continue
        for place in range(first + gap, first + count):
            t, prim_id, u, v = found.t[place], found.prim_id[place], found.u[place], found.v[place]
            into = place
            while into - gap >= first:
                before = into - gap
                if found.t[before] < t or (found.t[before] == t and found.prim_id[before] < prim_id):
                    break
                found.t[into], found.prim_id[into] = found.t[before], found.prim_id[before]
                found.u[into], found.v[into] = found.u[before], found.v[before]
                into = before
            found.t[into], found.prim_id[into], found.u[into], found.v[into] = t, prim_id, u, v


@out_of_line
def _settle(found, first, count, most, close):  # type: ignore[no-untyped-def]
    """Make t of sorted hits that are close to each other right, and sort anew; beyond the first `most` only those that
    are close to one of these."""
    end = first + min(count, most)
    while end < first + count and found.t[end] - found.t[end - 1] <= close.gap:
        end += 1
    for place in range(first, end):
        before = place > first and found.t[place] - found.t[place - 1] <= close.gap
        if before or (place + 1 < end and found.t[place + 1] - found.t[place] <= close.gap):
            found.u[place] = -found.u[place] - 1.0  # a mark; t stays as neighbours need it
    for place in range(first, end):
        if found.u[place] < -0.5:
            found.u[place] = -(found.u[place] + 1.0)
            found.t[place] = _settled(close, found.prim_id[place])
    _sort(found, first, end - first)


@njit(forceinline=True)
def _put_in_order(found, first, count, most, close):  # type: ignore[no-untyped-def]
    """Sort the hits of a ray, so that the first `most` are its nearest."""
    _sort(found, first, count)
    for place in range(first + 1, first + count):
        if found.t[place] - found.t[place - 1] <= close.gap:
            _settle(found, first, count, most, close)
            return


@njit(forceinline=True)
def _add_leaf(found, leaves, tree, node, child):  # type: ignore[no-untyped-def]
    """Add a leaf to those that a ray enters; returns their number. child: four times its number in the node."""
    found.entered[leaves] = first_block(tree, node, child)
    found.remaining[leaves] = np.int64(int32_at(node + BLOCK_COUNTS + child))
    return leaves + 1


@cache
def all_hits_kernel(counting: bool) -> Callable[..., None]:
    """The loop over rays for all hits; counting: only for their number."""

    @float_kernel
    def find_all(counter_address, tree, batch, lists, found, worker, most):  # type: ignore[no-untyped-def]
        """Find the hits of all rays that are not done, until a chunk has no room for its hits.

        most: hits to keep of each ray, the nearest, or after which to stop counting. found: this thread's memory,
        number `worker`.
        """
        exact, areas = found.exact.ctypes.data, found.areas.ctypes.data
        while True:
            chunk = fetch_add(counter_address, 1)
            if chunk >= len(lists.done):
                return
            first, last = chunk * CHUNK, min((chunk + 1) * CHUNK, len(lists.counts))
            nodes, following = -1, first + lists.done[chunk]
            for number in range(following, last):
                if number == following:
                    following = min(number + GROUP, last)
                    nodes = find_together(batch, number, following, tree, found)
                o, d, tnear, tfar, scale = scaled_ray(batch, number)
                start, count = found.used[0], np.int64(0)
                is_near, s = start_of(o, d, tnear, tree.sphere)
                if not (is_near and tnear < tfar and s < tfar):
                    lists.counts[number] = 0
                    if not counting:
                        lists.truncated[number], lists.places[number] = False, worker << WORKER_SHIFT | start
                    continue
                ray, line, worst = box_ray(o, d, s, tfar, tree.sphere), line_of(o, d, tree.sphere), 0.0
                place, top = 0, 0
                if nodes < 0:
                    found.stack[0], top = tree.nodes, 1
                while top > 0 or place < nodes:
                    leaves = 0
                    while place < nodes and leaves < LEAVES - CHILDREN:
                        node = found.nodes[place]
                        bits = entered(node, ray) & found.leaves[place]
                        place += 1
                        while bits:
                            leaves = _add_leaf(found, leaves, tree, node, 4 * first_bit(bits))
                            bits &= bits - 1
                    while top > 0 and leaves < LEAVES - CHILDREN:
                        top -= 1
                        node = found.stack[top]
                        bits = entered(node, ray)
                        while bits:
                            child = 4 * first_bit(bits)
                            bits &= bits - 1
                            if int32_at(node + BLOCK_COUNTS + child):
                                leaves = _add_leaf(found, leaves, tree, node, child)
                                continue
                            found.stack[top] = child_node(tree, node, child)
                            top += 1
                    while leaves > 0:
                        block = found.entered[leaves - 1]
                        found.remaining[leaves - 1] -= 1
                        found.entered[leaves - 1] = block + BLOCK_BYTES
                        if found.remaining[leaves - 1] == 0:
                            leaves -= 1
                        maybe, sure = candidates(block, line, areas)
                        while maybe:
                            k = first_bit(maybe)
                            maybe &= maybe - 1
                            sign, t, error, u, v = crossing_of(
                                block, k, sure >> k & 1, line, areas, (o, d), (tnear, tfar), exact, False
                            )
                            if sign == 0:
                                continue
                            if not counting:
                                into = start + count
                                if into >= len(found.t):
                                    lists.done[chunk] = number - first
                                    return
                                found.t[into], found.prim_id[into] = t * scale, prim_id_of(block, k)
                                found.u[into], found.v[into] = u, v
                                worst = max(worst, error)
                            count += 1
                            if counting and count >= most:
                                maybe = top = leaves = 0
                                place = nodes
                lists.counts[number] = min(count, most)
                if not counting:
                    lists.truncated[number] = count > most
                    lists.places[number] = worker << WORKER_SHIFT | start
                    if count > 1:
                        _put_in_order(found, start, count, most, Close(2.0 * worst * scale, o, d, scale, tree, exact))
                    found.used[0] = start + min(count, most)
            lists.done[chunk] = last - first

    return find_all


@kernel
def lay_out(counter_address, worker, lists, found, splits, t, prim_id, u, v):  # type: ignore[no-untyped-def]
    """Copy the hits that thread `worker` found to their places; splits: (N,) int64, place of each ray's first."""
    for number in range(len(lists.counts)):
        place = lists.places[number]
        if place >> WORKER_SHIFT == worker:
            one = place & ((1 << WORKER_SHIFT) - 1)
            into = splits[number]
            for k in range(lists.counts[number]):
                t[into + k], prim_id[into + k] = found.t[one + k], found.prim_id[one + k]
                u[into + k], v[into + k] = found.u[one + k], found.v[one + k]
