"""The loops over batches of rays for their nearest hits, or for whether they hit anything, decided without rounding."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import float_kernel
from atra.rays.all_hits.memory import CHUNK, RAY_LANES
from atra.rays.nearest.alone_kernels import is_hit_alone, memory_of, nearest_alone
from atra.rays.nearest.together_kernels import hit_together
from atra.rays.rays_kernels import scaled_ray


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
