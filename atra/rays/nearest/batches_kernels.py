"""The nearest hits of batches of rays, or whether they hit anything, decided without rounding.

Rays that are coherent go through the tree together. All of them enter a node where the intervals that hold their
numbers may; the box of a leaf is tested with each ray, and so are its triangles, with all rays at once.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import address_at, fetch_add, float_at, int32_at
from atra.compiled.lanes import first_bit
from atra.compiled.memory import doubles_at, store
from atra.compiled.store import float_kernel, float_part
from atra.compiled.vectors import bits_of, splat
from atra.exact.sums_kernels import UNIT
from atra.rays.all_hits.boxes_kernels import BOX_MARGIN, FAR_MARGIN, child_node, interval_in
from atra.rays.all_hits.crossings_kernels import ROUNDINGS, prim_id_of
from atra.rays.all_hits.memory import CHUNK, LEAF, RAY_LANES
from atra.rays.nearest.alone_kernels import NO_HIT, finished, is_hit_alone, memory_of, nearest_alone, put, put_in_order
from atra.rays.nearest.lanes_kernels import (
    AHEAD,
    NEAREST,
    NEAREST_ERROR,
    ORIGIN,
    ZERO_64,
    axis_of,
    begin_rays,
    entering,
    highest_of,
    largest_size,
    load_rays,
    range_of,
    spread,
    three_rows,
)
from atra.rays.nearest.triangles_kernels import cross_exactly, crossed, line_of, met_by, ray_of, take_nearer, tube_of
from atra.rays.rays_kernels import scaled_ray
from atra.trees.layout import BLOCK_BYTES
from atra.trees.wide import BLOCK_COUNTS, CHILDREN, FIRSTS


@float_part
def hit_together(any_hit, tree, rays, first, last, near_by, found, touches, before, t_of, answers):  # type: ignore[no-untyped-def]
    """Write the hits of rays from `first` up to, not including, `last`, RAY_LANES at most; returns -1 where they are
    not coherent, and nothing is written.

    near_by: how far apart coherent rays start. before: what the last call returned, 0 at first: with any_hit the leaf
    in which rays were hit, as it stands on the stack. These rays enter it first, as most of their neighbours hit what
    they hit. t_of, answers: as for `nearest_kernel`. Other arguments as for `nearest_alone`.

    Source: E. A. Haines, D. P. Greenberg, "The light buffer: a shadow-testing accelerator", 1986, which also asks the
    last occluder first.
    """
    memory, exact, waiting = found.lanes.ctypes.data, found.exact.ctypes.data, memory_of(found)
    is_coherent, left, octant, major, scale = load_rays(rays, first, last, near_by, memory)
    if not is_coherent:
        return np.int64(-1)
    at, places, hit = doubles_at(memory), found.hit_places.ctypes.data, np.int64(0)
    cx, cy, cz, radius = tree.sphere
    farthest = max(abs(at[0] - cx), abs(at[RAY_LANES] - cy), abs(at[2 * RAY_LANES] - cz)) + near_by
    if near_by == np.inf:
        ox, oy, oz = three_rows(memory + ORIGIN)
        farthest = highest_of(largest_size(ox - spread(cx), oy - spread(cy), oz - spread(cz)), ZERO_64)
    line = line_of(memory, major, ROUNDINGS * UNIT * (farthest + radius))
    margin = (max(abs(cx), abs(cy), abs(cz)) + 16.0 * radius) * BOX_MARGIN + farthest * FAR_MARGIN
    if left:
        left &= begin_rays(memory, tree.sphere, farthest, margin)
    for lane in range(last - first):
        answers[first + lane] = np.uint32(0) if any_hit else NO_HIT
        if not any_hit:
            t_of[first + lane] = np.inf
    if left == 0:
        return before
    margin_32 = np.float32(margin)
    x, y = axis_of(memory, 0, left, octant, margin_32), axis_of(memory, 1, left, octant, margin_32)
    z, tube = axis_of(memory, 2, left, octant, margin_32), tube_of(line)
    _, ahead = range_of(memory + AHEAD, left)
    start, end = splat(-margin_32, CHILDREN), splat(ahead, CHILDREN)
    store(splat(np.int64(0), RAY_LANES), places)
    put(waiting, 0, tree.nodes, -np.inf)
    top = 1
    if any_hit and before:
        put(waiting, 1, before, -np.inf)
        top = 2
    while top > 0:
        top -= 1
        if float_at(waiting.reached + 4 * top) > ahead:
            continue
        node = address_at(waiting.stack + 8 * top)
        if node & LEAF:
            child = node - LEAF
            active = entering(child, memory, octant, margin_32) & left
            if active == 0:
                continue
            changed = np.int64(0)
            block = tree.blocks + np.int64(int32_at(child + FIRSTS)) * BLOCK_BYTES
            for _ in range(int32_at(child + BLOCK_COUNTS)):
                met = met_by(block, tube)
                while met:
                    place = block + 4 * first_bit(met)
                    met &= met - 1
                    hits, unsure = crossed(place, line, memory)
                    hits &= active
                    unsure &= active
                    if unsure:
                        hits |= cross_exactly(place, unsure, memory, exact, touches)
                    if hits == 0:
                        continue
                    if any_hit:
                        before = node
                        changed |= hits
                        active &= ~hits
                        if active == 0:
                            break
                    else:
                        changed |= take_nearer(hits, place, memory, places, margin, exact)
                if active == 0:
                    break
                block += BLOCK_BYTES
            if any_hit:
                left &= ~changed
                hit |= changed
                if left == 0:
                    break
            elif changed:
                _, ahead = range_of(memory + AHEAD, left)
                end = splat(ahead, CHILDREN)
            continue
        near, far = interval_in(node, start, end, x, y, z)
        store(near, waiting.entries)
        bits = bits_of(near <= far)
        lowest = top
        while bits:
            child = 4 * first_bit(bits)
            bits &= bits - 1
            entry, to = float_at(waiting.entries + child), node + child + LEAF
            if int32_at(node + BLOCK_COUNTS + child) == 0:
                to = child_node(tree, node, child)
            put_in_order(waiting, lowest, top, to, entry)
            top += 1
    for lane in range(last - first):
        if any_hit:
            answers[first + lane] = hit >> lane & 1
            continue
        place = address_at(places + 8 * lane)
        if place:
            o, d = ray_of(memory, lane)
            t = finished(at[NEAREST // 8 + lane], at[NEAREST_ERROR // 8 + lane], place, 0, o, d, exact)
            t_of[first + lane], answers[first + lane] = t * scale, prim_id_of(place, 0)
    return before


@cache
def nearest_kernel(any_hit: bool) -> Callable[..., None]:
    """The loop over rays for their nearest hits; any_hit: for whether they hit anything."""

    @float_kernel
    def hit_rays(counter_address, tree, rays, near_by, found, touches, t_of, answers):  # type: ignore[no-untyped-def]
        """Write what each ray hits, those that are coherent together.

        rays: `RayBatch`. near_by: how far apart coherent rays start at most; below 0: none are looked for.
        found: this thread's memory. touches: as for `crossing`. t_of: (N,) float32, inf where nothing is hit.
        answers: (N,) uint32, triangles, `MISS` = none. With any_hit t_of is empty, and answers is (N,) uint8, 0 or 1.
        """
        count, memory, before = len(answers), memory_of(found), np.int64(0)
        while True:
            start = fetch_add(counter_address, 1) * CHUNK
            if start >= count:
                return
            for first in range(start, min(start + CHUNK, count), RAY_LANES):
                last = min(first + RAY_LANES, count)
                if near_by >= 0.0:
                    hit = hit_together(any_hit, tree, rays, first, last, near_by, found, touches, before, t_of, answers)
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
