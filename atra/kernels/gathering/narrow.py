"""Narrow triangles, the ordinary ones: as `atra.kernels.raster.narrow`, block after block, with every hit taken."""

from __future__ import annotations

import numpy as np
from numba import njit

from atra.kernels.gathering.lanes import columns_of, rows_of
from atra.kernels.gathering.taking import take
from atra.kernels.raster.exact import side
from atra.kernels.raster.vectors import bits_of, mask_of, rarely, repeated, smaller

BLOCK_ROWS = 2
"""Rows of the highest block, a divisor of the rows of a band, so that no block reaches into two of them."""


@njit
def _decided(x0, y0, x1, y1, x2, y2, facing, left, top, lanes, nx, exact):  # type: ignore[no-untyped-def]
    """Bits of the samples of a block that lie in the triangle, exactly."""
    bits = 0
    for lane in range(lanes):
        i, j = float(left + lane % nx), float(top + lane // nx)
        if (
            side(x0, y0, x1, y1, i, j, exact) == facing
            and side(x1, y1, x2, y2, i, j, exact) == facing
            and side(x2, y2, x0, y0, i, j, exact) == facing
        ):
            bits |= 1 << lane
    return bits


@njit(inline="always")
def take_narrow(  # type: ignore[no-untyped-def]
    kind, lanes, nx, parallel, has_depth, triangle, weight, x0, y0, x1, y1, x2, y2, facing, rounding, nearness,
    slope_x, slope_y, left, right, first, last, workspace, target,
):  # fmt: skip
    """Take the rows first ... last of a triangle whose corners all are in front of the eye, in blocks of `lanes` pixels
    in rows of nx. first: a multiple of a block's rows, perhaps above the triangle.

    Arguments as for `draw_narrow` of `atra.kernels.raster.narrow`; nearness: in column `left` of row `first`.
    """
    ny, j = lanes // nx, float(first)
    surely, hardly = repeated(rounding, lanes), repeated(-rounding, lanes)
    columns, rows = columns_of(lanes, nx), rows_of(lanes, nx)
    # Edge k lies opposite corner k.
    dx0, dy0 = facing * (x2 - x1), facing * (y2 - y1)
    dx1, dy1 = facing * (x0 - x2), facing * (y0 - y2)
    dx2, dy2 = facing * (x1 - x0), facing * (y1 - y0)
    within0 = rows * repeated(np.float32(dx0), lanes) - columns * repeated(np.float32(dy0), lanes)
    within1 = rows * repeated(np.float32(dx1), lanes) - columns * repeated(np.float32(dy1), lanes)
    within2 = rows * repeated(np.float32(dx2), lanes) - columns * repeated(np.float32(dy2), lanes)
    below0 = repeated(np.float32(ny * dx0), lanes)
    below1 = repeated(np.float32(ny * dx1), lanes)
    below2 = repeated(np.float32(ny * dx2), lanes)
    slope, down = repeated(np.float32(slope_x), lanes), repeated(np.float32(slope_y), lanes)
    nothing, one = repeated(np.float32(0.0), lanes), repeated(np.float32(1.0), lanes)
    for start in range(left, right + 1, nx):
        inside0 = repeated(np.float32(dx0 * (j - y1) - dy0 * (start - x1)), lanes) + within0
        inside1 = repeated(np.float32(dx1 * (j - y2) - dy1 * (start - x2)), lanes) + within1
        inside2 = repeated(np.float32(dx2 * (j - y0) - dy2 * (start - x0)), lanes) + within2
        along = (columns + repeated(np.float32(start - left), lanes)) * slope + rows * down
        pixel, row = first * target.row + start, nearness
        for y in range(first, last + 1, ny):
            inside = smaller(smaller(inside0, inside1), inside2)
            taken = inside > hardly
            if rarely(bits_of(taken & (inside <= surely)) != 0):
                exactly = _decided(x0, y0, x1, y1, x2, y2, int(facing), start, y, lanes, nx, workspace.exact)
                taken = taken & mask_of(exactly, lanes)
            depth = nothing
            if has_depth:
                found = repeated(np.float32(row), lanes) + along
                depth = nothing - found if parallel else one / found
            take(kind, lanes, nx, taken, depth, weight, triangle, pixel, target)
            inside0, inside1, inside2 = inside0 + below0, inside1 + below1, inside2 + below2
            pixel += ny * target.row
            row += ny * slope_y
