"""Spans: any triangle, row by row; as `atra.kernels.raster.spans`, with every hit taken."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.gathering.crossings import depth_at, facing_of, pinhole_plane
from atra.kernels.gathering.taking import take
from atra.kernels.raster.exact import turn
from atra.kernels.raster.image import GENTLE, SPAN
from atra.kernels.raster.memory import doubles_at
from atra.kernels.raster.spans import cut, parallel_plane
from atra.kernels.raster.vectors import counted, larger, mask_of, repeated, rounded, size, smaller


@njit(inline="always")
def take_spans(  # type: ignore[no-untyped-def]
    kind, lanes, parallel, has_depth, has_factors, view, points, v0, v1, v2, weight, triangle, top, bottom, width,
    workspace, target,
):  # fmt: skip
    """Take the rows top ... bottom of a triangle, with vectors of `lanes`. weight: taken if it is a factor."""
    facing_eye = facing_of(parallel, view, points, v0, v1, v2, workspace.exact)
    if facing_eye != 0 and top <= bottom:
        x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
        x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
        x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
        facing = turn(x0, y0, x1, y1, x2, y2, workspace.exact)
        own = weight if has_factors else np.float32(facing_eye)
        nearest, farthest, least = max(w0, w1, w2), min(w0, w1, w2), 1.0
        at_image_plane = parallel and nearest >= 0.0
        slope_x = slope_y = constant = 0.0
        if has_depth:
            if parallel:
                slope_x, slope_y, constant = parallel_plane(x0, y0, w0, x1, y1, w1, x2, y2, w2)
                least = -nearest
            else:
                slope_x, slope_y, constant = pinhole_plane(view, v0, v1, v2)
                if farthest < 0.0:
                    nearest, farthest = np.inf, np.inf
                    for w in (w0, w1, w2):
                        farthest = min(farthest, w if w > 0.0 else np.inf)
                least = farthest
        is_gentle = abs(slope_x) * SPAN <= GENTLE * least
        firsts, lasts = doubles_at(workspace.first), doubles_at(workspace.last)
        for k in range(bottom - top + 1):
            firsts[k], lasts[k] = 0.0, width - 1.0
        for px, py, qx, qy, wanted in (
            (x1, y1, x2, y2, -facing if not parallel and w0 < 0.0 else facing),
            (x2, y2, x0, y0, -facing if not parallel and w1 < 0.0 else facing),
            (x0, y0, x1, y1, -facing if not parallel and w2 < 0.0 else facing),
        ):
            if qy != py:
                cut(px, py, qx, qy, (qy > py) == (wanted < 0), top, bottom - top + 1, width, workspace)
            else:
                for k in range(bottom - top + 1):
                    if qx == px or wanted != (1 if (qx > px) == (top + k >= py) else -1):
                        lasts[k] = -1.0
        step, step_wide = repeated(np.float32(slope_x), lanes), repeated(slope_x, lanes)
        low, high = repeated(farthest, lanes), repeated(nearest, lanes)
        nothing, one = repeated(np.float32(0.0), lanes), repeated(np.float32(1.0), lanes)
        for k in range(bottom - top + 1):
            first, last = int(firsts[k]), int(lasts[k])
            row = slope_y * (top + k) + constant
            before, end = repeated(np.float32(first - 1), lanes), repeated(np.float32(last), lanes)
            pixel = (top + k) * target.row
            if at_image_plane:
                for x in range(first, last + 1):
                    deep = np.float32(depth_at(parallel, view, points, v0, v1, v2, float(x), float(top + k)))
                    if deep > 0.0:
                        take(kind, 1, 1, mask_of(1, 1), repeated(deep, 1), own, triangle, pixel + x, target)
            else:
                for start in range(first // lanes * lanes, last + 1, lanes):
                    columns = counted(np.float32(start), lanes)
                    depth = nothing
                    if has_depth:
                        if is_gentle:
                            base = start // SPAN * SPAN
                            found = repeated(np.float32(row + slope_x * base), lanes)
                            found = found + counted(np.float32(start - base), lanes) * step
                        else:
                            wide = repeated(row, lanes) + counted(float(start), lanes) * step_wide
                            if not parallel:
                                wide = size(wide)  # the sign is wrong where the eye is in the plane but for rounding
                            found = rounded(smaller(larger(wide, low), high))
                        depth = nothing - found if parallel else one / found
                    taken = (columns > before) & (columns <= end)
                    take(kind, lanes, lanes, taken, depth, own, triangle, pixel + start, target)
