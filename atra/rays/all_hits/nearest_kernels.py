"""The loop over rays for their nearest hits, or for whether they hit anything, decided without rounding."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add, float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.store import float_kernel
from atra.prim_ids import MISS
from atra.rays.all_hits.boxes_kernels import box_ray, entered_at, shortened, start_of
from atra.rays.all_hits.crossings_kernels import candidates, crossing, line_of, prim_id_of, scaled_ray, sure_crossing
from atra.rays.all_hits.finding_kernels import LEAF
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import COUNTS, FIRSTS, WIDE_BYTES

CHUNK = 64
"""Rays a thread takes at a time."""


@cache
def nearest_kernel(any_hit: bool) -> Callable[..., None]:
    """The loop over some rays of a batch; any_hit: only for whether they hit anything."""

    @float_kernel
    def find_nearest(counter_address, tree, rays, numbers, found, touches, t_of, prim_id_of_ray):  # type: ignore[no-untyped-def]
        """Write the nearest hit of the rays named by `numbers`, (D,) int64, and nothing else.

        rays: `Batch`. found: this thread's memory. touches: as for `crossing`. t_of: (N,) float32. prim_id_of_ray: (N,)
        uint32, `MISS` = none.
        """
        exact, areas, entries = found.exact.ctypes.data, found.areas.ctypes.data, found.entries.ctypes.data
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= len(numbers):
                return
            for place in range(start, min(start + CHUNK, len(numbers))):
                number = numbers[place]
                o, d, tnear, tfar, scale = scaled_ray(rays, number)
                nearest, triangle = tfar, np.uint32(MISS)
                is_near, s = start_of(o, d, tnear, tree.sphere)
                top = 0
                if is_near and tnear < tfar and s < tfar:
                    found.stack[0], found.reached[0] = tree.nodes, -np.inf
                    top = 1
                ray, line = box_ray(o, d, s, tfar, tree.sphere), line_of(o, d, tree.sphere)
                limit = np.inf
                while top > 0:
                    top -= 1
                    node = found.stack[top]
                    if found.reached[top] > limit:
                        continue
                    if node & LEAF:
                        maybe, sure = candidates(node - LEAF, line, areas)
                        while maybe:
                            k = first_bit(maybe)
                            maybe &= maybe - 1
                            sign, t = 2, 0.0
                            if sure >> k & 1:
                                sign, t, _, _ = sure_crossing(areas, k, line, tnear, tfar)
                            if sign == 2:
                                given = o, d, tnear, tfar, line[4], exact, touches
                                sign, t, _, _ = crossing(node - LEAF, k, *given)
                            if sign == 0:
                                continue
                            prim_id = prim_id_of(node - LEAF, k)
                            if triangle == MISS or t < nearest or (t == nearest and prim_id < triangle):
                                nearest, triangle = t, prim_id
                                ray, limit = shortened(ray, s, t)
                            if any_hit:
                                maybe = top = 0
                        continue
                    bits = entered_at(node, ray, entries)
                    first = top
                    while bits:
                        child = 4 * first_bit(bits)
                        bits &= bits - 1
                        entry = float_at(entries + child)
                        first_of = np.int64(int32_at(node + FIRSTS + child))
                        blocks = np.int64(int32_at(node + COUNTS + child))
                        for block in range(max(blocks, 1)):
                            to = tree.blocks + (first_of + block) * BLOCK_BYTES + LEAF
                            if blocks == 0:
                                to = tree.nodes + first_of * WIDE_BYTES
                            into = top  # the farthest stands lowest
                            while into > first and found.reached[into - 1] < entry:
                                found.stack[into], found.reached[into] = found.stack[into - 1], found.reached[into - 1]
                                into -= 1
                            found.stack[into], found.reached[into] = to, entry
                            top += 1
                prim_id_of_ray[number] = triangle
                if not any_hit:
                    t_of[number] = nearest * scale if triangle != MISS else np.inf

    return find_nearest
