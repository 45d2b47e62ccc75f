"""Every crossing of an image, by the rule that all methods keep."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel, njit
from atra.raster.all_hits.crossings_kernels import covers, depth_at, facing_of


@njit(forceinline=True)
def _inside_of_image(low, high, last):  # type: ignore[no-untyped-def]
    """The first and last whole number of 0 ... last from `low` to `high`."""
    return max(int(np.ceil(max(low, 0.0))), 0), int(np.floor(min(high, float(last))))


@kernel
def list_crossings(parallel, view, points, faces, width, height, exact, pixels, prim_ids, facings, depths):  # type: ignore[no-untyped-def]
    """Every crossing of an image, triangle by triangle, each sample of its box tested; returns how many there are.

    points: of `projected`. pixels: (N,) int64, y * width + x; prim_ids: (N,) uint32, facings: (N,) int8, depths: (N,)
    float64: written as far as they reach.
    """
    count = 0
    for triangle in range(len(faces)):
        v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        facing = facing_of(parallel, view, points, v0, v1, v2, exact)
        if facing == 0:
            continue
        left, right, top, bottom = 0, width - 1, 0, height - 1
        if parallel or min(points[v0, 2], points[v1, 2], points[v2, 2]) > 0.0:
            x0, x1, x2 = points[v0, 0], points[v1, 0], points[v2, 0]
            y0, y1, y2 = points[v0, 1], points[v1, 1], points[v2, 1]
            left, right = _inside_of_image(min(x0, x1, x2), max(x0, x1, x2), right)
            top, bottom = _inside_of_image(min(y0, y1, y2), max(y0, y1, y2), bottom)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                if not covers(parallel, points, v0, v1, v2, float(x), float(y), exact):
                    continue
                depth = depth_at(parallel, view, points, v0, v1, v2, float(x), float(y))
                if depth <= 0.0:
                    continue
                if count < len(pixels):
                    pixels[count], prim_ids[count] = y * width + x, triangle
                    facings[count], depths[count] = facing, depth
                count += 1
    return count
