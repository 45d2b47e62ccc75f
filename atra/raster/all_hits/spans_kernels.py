"""Spans: any triangle, row by row; as `atra.raster.spans`, with every hit taken."""

from __future__ import annotations

import numpy as np

from atra.all_hits.taking_kernels import take
from atra.compiled.memory import doubles_at
from atra.compiled.store import njit
from atra.compiled.vectors import arange, mask_of, splat
from atra.raster.all_hits.crossings_kernels import parallel_depth
from atra.raster.spans import find_spans, from_eye, homogeneous, nearness_of
from atra.raster.triangles import corner_at


@njit(forceinline=True)
def take_spans(  # type: ignore[no-untyped-def]
    kind, lanes, parallel, has_depth, has_factors, eye, vertices, vertex_count, weight, prim_id, packed, width, band,
    workspace, target,
):  # fmt: skip
    """Take what a band has of a triangle, with vectors of `lanes`. weight: taken if it is a factor.

    Others as for `draw_spans`.
    """
    spans = find_spans(parallel, eye, vertices, vertex_count, packed, width, band, workspace)
    if spans.facing != 0:
        w0 = corner_at(workspace.points, packed, 0)[2]
        w1 = corner_at(workspace.points, packed, 1)[2]
        w2 = corner_at(workspace.points, packed, 2)[2]
        facing = spans.facing
        if not parallel:  # each corner behind the eye turns the triangle over
            for w in (w0, w1, w2):
                facing = -facing if w < 0.0 else facing
        own = weight if has_factors else np.float32(facing)
        firsts, lasts = doubles_at(workspace.first), doubles_at(workspace.last)
        nothing, one = splat(np.float32(0.0), lanes), splat(np.float32(1.0), lanes)
        for k in range(spans.bottom - spans.top + 1):
            y, first, last = spans.top + k, int(firsts[k]), int(lasts[k])
            row = spans.slope_y * y + spans.constant
            pixel = y * target.row
            if parallel and spans.nearest >= 0.0:  # it reaches behind the image plane
                a = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 0))
                b = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 1))
                c = homogeneous(doubles_at(eye.to_pixels), from_eye(eye, vertices, vertex_count, packed, 2))
                for x in range(first, last + 1):
                    deep = np.float32(parallel_depth(a, b, c, w0, w1, w2, float(x), float(y)))
                    if deep > 0.0:
                        take(kind, 1, 1, mask_of(1, 1), splat(deep, 1), own, prim_id, pixel + x, target)
            else:
                before, end = splat(np.float32(first - 1), lanes), splat(np.float32(last), lanes)
                for start in range(first // lanes * lanes, last + 1, lanes):
                    columns = arange(np.float32(start), lanes)
                    depth = nothing
                    if has_depth:
                        found = nearness_of(parallel, lanes, spans, row, start)
                        depth = nothing - found if parallel else one / found
                    taken = (columns > before) & (columns <= end)
                    take(kind, lanes, lanes, taken, depth, own, prim_id, pixel + start, target)
