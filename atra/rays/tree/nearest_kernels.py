"""The nearest hits of batches of rays, or whether they hit anything, decided without rounding.

Rays that are coherent go through the tree together. All of them enter a node where the intervals that hold their
numbers may; the box of a leaf is tested with each ray, and so are its triangles, with all rays at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from atra.compiled.intrinsics import address_at, fetch_add, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, store
from atra.compiled.store import float_kernel, float_part, njit
from atra.compiled.vectors import splat
from atra.prim_ids import MISS
from atra.rays.rays_kernels import scaled_ray
from atra.rays.tree.alone_kernels import alone_of, meet_of
from atra.rays.tree.boxes_kernels import ahead_of, enter_alone, enter_together, shortened, start_of
from atra.rays.tree.crossings_kernels import is_before, parameter, prim_id_of
from atra.rays.tree.lanes_kernels import AHEAD, NEAREST, NEAREST_ERROR, begin_together, entering, load_rays, range_of
from atra.rays.tree.memory import CHUNK, RAY_LANES
from atra.rays.tree.triangles_kernels import cross_exactly, crossed, line_of, met_by, ray_of, take_nearer, tube_of
from atra.rays.tree.walk_kernels import DONE, LEAF, first_block, put, walk_of
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS

NO_HIT = np.uint32(MISS)

_CLOSE = 2.0**-27
"""Largest error of a parameter, as a share of it, that leaves it right to a unit of float32."""


@njit(forceinline=True)
def _finished(t, error, block, k, o, d, exact):  # type: ignore[no-untyped-def]
    """The parameter of a hit, right to a unit of float32."""
    return t if error <= _CLOSE * t else parameter(block, k, o, d, exact)


@njit(forceinline=True)
def _take_nearer(block, k, crossing, query, ahead, nearest, alone):  # type: ignore[no-untyped-def]
    """Keep a hit that comes before the nearest so far, by their parameters, or without rounding where these do not
    tell. nearest: (t, error, block, k); block 0: there is none."""
    _, t, error, _, _ = crossing
    before, before_error, other, m = nearest
    gap, errors = t - before, error + before_error
    if other == 0 or gap < -errors or (not gap > errors and is_before(block, k, other, m, *alone.ray, alone.exact)):
        ahead = ahead_of(alone.start, t + error, alone.margin)
        query, nearest = shortened(query, ahead), (t, error, block, k)
    return query, ahead, nearest


@njit(forceinline=True)
def _take_any(block, k, crossing, query, ahead, is_hit, alone):  # type: ignore[no-untyped-def]
    return query, DONE, True


_walk_to_nearest = walk_of(enter_alone, meet_of(_take_nearer), in_order=True)
_walk_to_any = walk_of(enter_alone, meet_of(_take_any), in_order=False)


@float_part
def nearest_alone(tree, o, d, tnear, tfar, memory, touches):  # type: ignore[no-untyped-def]
    """(t, prim_id) of the nearest hit of a ray; inf and `MISS` where there is none.

    o, d, tnear, tfar: of `scaled_ray`. touches: as for `crossing`.
    """
    may_hit, s = start_of(o, d, tnear, tfar, tree.sphere)
    if not may_hit:
        return np.inf, NO_HIT
    query, ahead, alone = alone_of(tree, o, d, tnear, tfar, s, memory, touches)
    put(memory, 0, tree.nodes, -np.inf)
    nobody = tfar, 0.0, np.int64(0), np.int64(0)
    t, error, block, k = _walk_to_nearest(tree, memory, 1, 0, query, ahead, nobody, alone)
    if block == 0:
        return np.inf, NO_HIT
    return _finished(t, error, block, k, o, d, memory.exact), prim_id_of(block, k)


@float_part
def is_hit_alone(tree, o, d, tnear, tfar, memory, touches):  # type: ignore[no-untyped-def]
    """Whether a ray hits anything. Arguments as for `nearest_alone`."""
    may_hit, s = start_of(o, d, tnear, tfar, tree.sphere)
    if not may_hit:
        return False
    query, ahead, alone = alone_of(tree, o, d, tnear, tfar, s, memory, touches)
    put(memory, 0, tree.nodes, -np.inf)
    return _walk_to_any(tree, memory, 1, 0, query, ahead, False, alone)


def _meet_together(any_hit: bool) -> Any:
    @njit(forceinline=True)
    def meet(tree, leaf, query, ahead, state, given):  # type: ignore[no-untyped-def]
        """Test a leaf's triangles with all rays. state: bits of the rays that still look for hits, bits of those that
        have one, and the leaf in which one was found last."""
        left, hit, last = state
        memory, line, tube, octant, margin, touches = given
        lanes = memory.lanes
        active, changed = entering(leaf, lanes, octant, np.float32(margin)) & left, np.int64(0)
        if active == 0:
            return query, ahead, state
        block = first_block(tree, leaf)
        for _ in range(int32_at(leaf + BLOCK_COUNTS)):
            met = met_by(block, tube)
            while met and active:
                place = block + 4 * first_bit(met)
                met &= met - 1
                hits, unsure = crossed(place, line, lanes)
                hits &= active
                unsure &= active
                if unsure:
                    hits |= cross_exactly(place, unsure, lanes, memory.exact, touches)
                if hits == 0:
                    continue
                if any_hit:
                    last = leaf
                    changed |= hits
                    active &= ~hits
                else:
                    changed |= take_nearer(hits, place, lanes, memory.places, margin, memory.exact)
            block += BLOCK_BYTES
        if any_hit:
            left &= ~changed
            hit |= changed
            if left == 0:
                ahead = DONE
        elif changed:
            _, ahead = range_of(lanes + AHEAD, left)
            query = shortened(query, ahead)
        return query, ahead, (left, hit, last)

    return meet


_walk_to_nearest_together = walk_of(enter_together, _meet_together(False), in_order=True)
_walk_to_any_together = walk_of(enter_together, _meet_together(True), in_order=True)


@float_part
def hit_together(any_hit, tree, rays, first, last, near_by, memory, touches, before, t_of, answers):  # type: ignore[no-untyped-def]
    """Write the hits of rays from `first` up to, not including, `last`, RAY_LANES at most; returns -1 where they are
    not coherent, and nothing is written.

    near_by: how far apart coherent rays start. before: what the last call returned, 0 at first: with any_hit the leaf
    in which rays were hit. These rays enter it first, as most of their neighbours hit what they hit. t_of, answers: as
    for `nearest_kernel`. Other arguments as for `nearest_alone`.

    Source: E. A. Haines, D. P. Greenberg, "The light buffer: a shadow-testing accelerator", 1986, which also asks the
    last occluder first.
    """
    lanes, at = memory.lanes, doubles_at(memory.lanes)
    is_coherent, left, octant, major, scale = load_rays(rays, first, last, near_by, lanes)
    if not is_coherent:
        return np.int64(-1)
    left, query, ahead, margin, error = begin_together(tree, lanes, left, octant, near_by)
    for lane in range(last - first):
        answers[first + lane] = np.uint32(0) if any_hit else NO_HIT
        if not any_hit:
            t_of[first + lane] = np.inf
    if left == 0:
        return before
    line = line_of(lanes, major, error)
    given, state = (memory, line, tube_of(line), octant, margin, touches), (left, np.int64(0), before)
    put(memory, 0, tree.nodes, -np.inf)
    if any_hit:
        put(memory, 1, before + LEAF, -np.inf)
        top = 2 if before else 1
        _, hit, before = _walk_to_any_together(tree, memory, top, 0, query, ahead, state, given)
        for lane in range(last - first):
            answers[first + lane] = hit >> lane & 1
        return before
    store(splat(np.int64(0), RAY_LANES), memory.places)
    _walk_to_nearest_together(tree, memory, 1, 0, query, ahead, state, given)
    for lane in range(last - first):
        place = address_at(memory.places + 8 * lane)
        if place:
            o, d = ray_of(lanes, lane)
            t = _finished(at[NEAREST // 8 + lane], at[NEAREST_ERROR // 8 + lane], place, 0, o, d, memory.exact)
            t_of[first + lane], answers[first + lane] = t * scale, prim_id_of(place, 0)
    return before


@cache
def nearest_kernel(any_hit: bool) -> Callable[..., None]:
    """The loop over rays for their nearest hits; any_hit: for whether they hit anything."""

    @float_kernel
    def hit_rays(counter_address, tree, rays, near_by, memory, touches, t_of, answers):  # type: ignore[no-untyped-def]
        """Write what each ray hits, those that are coherent together.

        rays: `RayBatch`. near_by: how far apart coherent rays start at most; below 0: none are looked for.
        memory: this thread's. touches: as for `crossing`. t_of: (N,) float32, inf where nothing is hit.
        answers: (N,) uint32, triangles, `MISS` = none. With any_hit t_of is empty, and answers is (N,) uint8, 0 or 1.
        """
        count, before = len(answers), np.int64(0)
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= count:
                return
            for first in range(start, min(start + CHUNK, count), RAY_LANES):
                last = min(first + RAY_LANES, count)
                if near_by >= 0.0:
                    hit = hit_together(
                        any_hit, tree, rays, first, last, near_by, memory, touches, before, t_of, answers
                    )
                    if hit >= 0:
                        before = hit
                        continue
                for number in range(first, last):
                    o, d, tnear, tfar, scale = scaled_ray(rays, number)
                    if any_hit:
                        answers[number] = is_hit_alone(tree, o, d, tnear, tfar, memory, touches)
                    else:
                        t, prim_id = nearest_alone(tree, o, d, tnear, tfar, memory, touches)
                        t_of[number], answers[number] = t * scale, prim_id

    return hit_rays
