"""Narrow triangles, the ordinary ones: as `atra.kernels.raster.narrow`, with every hit taken."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.gathering.taking import take
from atra.kernels.raster.exact import side
from atra.kernels.raster.vectors import bits_of, counted, mask_of, rarely, repeated, smaller


@njit
def decided(x0, y0, x1, y1, x2, y2, facing, left, j, lanes, exact):  # type: ignore[no-untyped-def]
    """Bits of the samples of row j from column `left` on that lie in the triangle, exactly."""
    bits = 0
    for lane in range(lanes):
        i = float(left + lane)
        if (
            side(x0, y0, x1, y1, i, j, exact) == facing
            and side(x1, y1, x2, y2, i, j, exact) == facing
            and side(x2, y2, x0, y0, i, j, exact) == facing
        ):
            bits |= 1 << lane
    return bits


@njit(inline="always")
def take_narrow(  # type: ignore[no-untyped-def]
    kind, lanes, parallel, has_depth, triangle, weight, x0, y0, x1, y1, x2, y2, facing, rounding, nearness,
    slope_x, slope_y, left, right, first, last, workspace, target,
):  # fmt: skip
    """Take the rows first ... last of a triangle whose corners all are in front of the eye, with vectors of `lanes`.

    Arguments as for `draw_narrow` of `atra.kernels.raster.narrow`.
    """
    j = float(first)
    surely, hardly = repeated(rounding, lanes), repeated(-rounding, lanes)
    # Edge k lies opposite corner k.
    dx0, dy0 = facing * (x2 - x1), facing * (y2 - y1)
    dx1, dy1 = facing * (x0 - x2), facing * (y0 - y2)
    dx2, dy2 = facing * (x1 - x0), facing * (y1 - y0)
    columns = counted(np.float32(0.0), lanes)
    column0 = columns * repeated(np.float32(-dy0), lanes)
    column1 = columns * repeated(np.float32(-dy1), lanes)
    column2 = columns * repeated(np.float32(-dy2), lanes)
    row0 = repeated(np.float32(dx0), lanes)
    row1 = repeated(np.float32(dx1), lanes)
    row2 = repeated(np.float32(dx2), lanes)
    slope = repeated(np.float32(slope_x), lanes)
    nothing, one = repeated(np.float32(0.0), lanes), repeated(np.float32(1.0), lanes)
    for start in range(left, right + 1, lanes):
        inside0 = repeated(np.float32(dx0 * (j - y1) - dy0 * (start - x1)), lanes) + column0
        inside1 = repeated(np.float32(dx1 * (j - y2) - dy1 * (start - x2)), lanes) + column1
        inside2 = repeated(np.float32(dx2 * (j - y0) - dy2 * (start - x0)), lanes) + column2
        along = counted(np.float32(start - left), lanes) * slope
        pixel, row = first * target.row + start, nearness
        for y in range(first, last + 1):
            inside = smaller(smaller(inside0, inside1), inside2)
            taken = inside > hardly
            if rarely(bits_of(taken & (inside <= surely)) != 0):
                exactly = decided(x0, y0, x1, y1, x2, y2, int(facing), start, float(y), lanes, workspace.exact)
                taken = taken & mask_of(exactly, lanes)
            depth = nothing
            if has_depth:
                found = repeated(np.float32(row), lanes) + along
                depth = nothing - found if parallel else one / found
            take(kind, lanes, lanes, taken, depth, weight, triangle, pixel, target)
            inside0, inside1, inside2 = inside0 + row0, inside1 + row1, inside2 + row2
            pixel += target.row
            row += slope_y
