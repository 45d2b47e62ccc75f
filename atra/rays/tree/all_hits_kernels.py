"""The loops over batches of rays for all their hits: finding, sorting and counting them, and laying them out."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from atra.compiled.intrinsics import address_at, fetch_add, uint32_at
from atra.compiled.memory import store
from atra.compiled.store import float_kernel, float_part, kernel, njit
from atra.compiled.vectors import splat
from atra.exact.lines_kernels import plane_parameter
from atra.exact.sums_kernels import out_of_line
from atra.rays.rays_kernels import are_coherent, scaled_ray, vector_at
from atra.rays.tree.alone_kernels import alone_of, meet_of
from atra.rays.tree.boxes_kernels import enter_alone, enter_together, start_of
from atra.rays.tree.crossings_kernels import prim_id_of
from atra.rays.tree.lanes_kernels import begin_together, entering, load_rays
from atra.rays.tree.memory import CHUNK, MOST_LEAVES, RAY_LANES, WORKER_SHIFT, TreeAddresses
from atra.rays.tree.walk_kernels import DONE, hold, put, walk_of

_GAPS = (701, 301, 132, 57, 23, 10, 4, 1)
"""Steps of a Shell sort. Source: M. Ciura, "Best increments for the average case of Shellsort", 2001."""

_NEAR_BY = 1 / 16
"""How far apart rays start at most whose hits are found together, as a share of the mesh's radius."""

_HELD = 56
"""Leaves held back while the tree is walked through for all hits."""


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
def _sort(hits, first, count):  # type: ignore[no-untyped-def]
    """Sort hits by t, and by prim_id where it is the same."""
    for gap in _GAPS:
        if gap >= count:
            continue
        for place in range(first + gap, first + count):
            t, prim_id, u, v = hits.t[place], hits.prim_id[place], hits.u[place], hits.v[place]
            into = place
            while into - gap >= first:
                before = into - gap
                if hits.t[before] < t or (hits.t[before] == t and hits.prim_id[before] < prim_id):
                    break
                hits.t[into], hits.prim_id[into] = hits.t[before], hits.prim_id[before]
                hits.u[into], hits.v[into] = hits.u[before], hits.v[before]
                into = before
            hits.t[into], hits.prim_id[into], hits.u[into], hits.v[into] = t, prim_id, u, v


@out_of_line
def _settle(hits, first, count, most, close):  # type: ignore[no-untyped-def]
    """Make t of sorted hits that are close to each other right, and sort again; beyond the first `most` only those that
    are close to one of these."""
    end = first + min(count, most)
    while end < first + count and hits.t[end] - hits.t[end - 1] <= close.gap:
        end += 1
    for place in range(first, end):
        before = place > first and hits.t[place] - hits.t[place - 1] <= close.gap
        if before or (place + 1 < end and hits.t[place + 1] - hits.t[place] <= close.gap):
            hits.u[place] = -hits.u[place] - 1.0  # a mark; t stays as neighbours need it
    for place in range(first, end):
        if hits.u[place] < -0.5:
            hits.u[place] = -(hits.u[place] + 1.0)
            hits.t[place] = _settled(close, hits.prim_id[place])
    _sort(hits, first, end - first)


@njit(forceinline=True)
def _put_in_order(hits, first, count, most, close):  # type: ignore[no-untyped-def]
    """Sort the hits of a ray, so that the first `most` are its nearest."""
    _sort(hits, first, count)
    for place in range(first + 1, first + count):
        if hits.t[place] - hits.t[place - 1] <= close.gap:
            _settle(hits, first, count, most, close)
            return


@njit(forceinline=True)
def _count(block, k, crossing, query, ahead, counted, alone):  # type: ignore[no-untyped-def]
    """Count a crossing. counted: their number and the sum of their signs."""
    return query, ahead, (counted[0] + 1, counted[1] + crossing[0])


@njit(forceinline=True)
def _keep(block, k, crossing, query, ahead, kept, alone):  # type: ignore[no-untyped-def]
    """Keep a crossing where there is room. kept: place of the next; largest error so far; hits, and the scale of t."""
    into, worst, hits, scale = kept
    if into < len(hits.t):
        _, t, error, u, v = crossing
        hits.t[into], hits.prim_id[into], hits.u[into], hits.v[into] = t * scale, prim_id_of(block, k), u, v
        worst = max(worst, error)
    return query, ahead, (into + 1, worst, hits, scale)


@njit(forceinline=True)
def _note(tree, leaf, query, ahead, noted, given):  # type: ignore[no-untyped-def]
    """Note a leaf, and the rays that enter it. noted: leaves so far, more than MOST_LEAVES: there is no room."""
    memory, left, octant, margin = given
    marks = entering(leaf, memory.lanes, octant, np.float32(margin)) & left
    if marks:
        if noted == MOST_LEAVES:
            return query, DONE, noted + 1
        store(splat(np.int64(leaf), 1), memory.noted + 8 * noted)
        store(splat(marks, 1), memory.marks + 8 * noted)
        noted += 1
    return query, ahead, noted


_walk_and_count = walk_of(enter_alone, meet_of(_count), in_order=False, held=_HELD)
_walk_and_keep = walk_of(enter_alone, meet_of(_keep), in_order=False, held=_HELD)
_walk_and_note = walk_of(enter_together, _note, in_order=False)


@float_part
def find_together(tree, rays, first, last, memory):  # type: ignore[no-untyped-def]
    """The number of leaves that rays from `first` up to `last` may enter, -1 where they had better go alone; writes
    which these are to `memory.noted`, and which rays enter them to `memory.marks`."""
    near_by = _NEAR_BY * tree.sphere[3]
    if not are_coherent(rays, first, last - first, near_by):
        return np.int64(-1)
    is_coherent, left, octant, _, _ = load_rays(rays, first, last, near_by, memory.lanes)
    if not is_coherent:
        return np.int64(-1)
    left, query, ahead, margin, _ = begin_together(tree, memory.lanes, left, octant, near_by)
    if left == 0:
        return np.int64(0)
    put(memory, 0, tree.nodes, -np.inf)
    noted = _walk_and_note(tree, memory, 1, 0, query, ahead, np.int64(0), (memory, left, octant, margin))
    return noted if noted <= MOST_LEAVES else np.int64(-1)


@njit(forceinline=True)
def _begin(tree, memory, noted, lane):  # type: ignore[no-untyped-def]
    """(top of the stack, leaves that wait) where a ray begins: the leaves noted, or the root of the tree."""
    if noted < 0:
        put(memory, 0, tree.nodes, -np.inf)
        return np.int64(1), np.int64(0)
    leaves = np.int64(0)
    for place in range(noted):
        if address_at(memory.marks + 8 * place) >> lane & 1:
            hold(memory, leaves, address_at(memory.noted + 8 * place))
            leaves += 1
    return np.int64(0), leaves


@cache
def all_hits_kernel(counting: bool) -> Callable[..., None]:
    """The loop over rays for all hits; counting: only for their number and the sum of their signs, which it writes to
    `places`."""

    @float_kernel
    def find_all(counter_address, tree, rays, lists, memory, hits, worker, most):  # type: ignore[no-untyped-def]
        """Find the hits of all rays that are not done, until a chunk has no room for its hits.

        most: hits to keep of each ray, the nearest. memory, hits: of this thread, number `worker`.
        """
        while True:
            chunk = fetch_add(counter_address, 1)
            if chunk >= len(lists.done):
                return
            first, last = chunk * CHUNK, min((chunk + 1) * CHUNK, len(lists.counts))
            begin = end = first + lists.done[chunk]
            noted = np.int64(-1)
            for number in range(begin, last):
                if number == end:
                    begin, end = end, min(end + RAY_LANES, last)
                    noted = find_together(tree, rays, begin, end, memory)
                o, d, tnear, tfar, scale = scaled_ray(rays, number)
                start, count, turn = hits.used[0], np.int64(0), np.int64(0)
                may_hit, s = start_of(o, d, tnear, tfar, tree.sphere)
                if may_hit and noted != 0:
                    query, ahead, alone = alone_of(tree, o, d, tnear, tfar, s, memory, False)
                    top, leaves = _begin(tree, memory, noted, number - begin)
                    if counting:
                        none = count, turn
                        count, turn = _walk_and_count(tree, memory, top, leaves, query, ahead, none, alone)
                    else:
                        none = start, 0.0, hits, scale
                        into, worst, _, _ = _walk_and_keep(tree, memory, top, leaves, query, ahead, none, alone)
                        if into > len(hits.t):
                            lists.done[chunk] = number - first
                            return
                        count = into - start
                        if count > 1:
                            close = Close(2.0 * worst * scale, o, d, scale, tree, memory.exact)
                            _put_in_order(hits, start, count, most, close)
                lists.counts[number], lists.truncated[number] = min(count, most), count > most
                lists.places[number] = turn if counting else worker << WORKER_SHIFT | start
                if not counting:
                    hits.used[0] = start + min(count, most)
            lists.done[chunk] = last - first

    return find_all


@kernel
def lay_out(counter_address, worker, lists, hits, splits, t, prim_id, u, v):  # type: ignore[no-untyped-def]
    """Copy the hits that thread `worker` found to their places; splits: (N,) int64, place of each ray's first."""
    for number in range(len(lists.counts)):
        place = lists.places[number]
        if place >> WORKER_SHIFT == worker:
            one = place & ((1 << WORKER_SHIFT) - 1)
            into = splits[number]
            for k in range(lists.counts[number]):
                t[into + k], prim_id[into + k] = hits.t[one + k], hits.prim_id[one + k]
                u[into + k], v[into + k] = hits.u[one + k], hits.v[one + k]
