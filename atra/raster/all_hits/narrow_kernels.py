"""Narrow triangles, the ordinary ones: as `atra.raster.narrow`, block after block, with every hit taken."""

from __future__ import annotations

import numpy as np

from atra.all_hits.taking_kernels import take
from atra.compiled.lanes import columns_of, rows_of
from atra.compiled.memory import doubles_at, floats_at
from atra.compiled.store import njit
from atra.compiled.vectors import bits_of, mask_of, rarely, smaller, splat, where
from atra.raster.narrow import decided
from atra.raster.triangles import (
    BATCH,
    CAP,
    COLUMN,
    FIRST,
    INSIDE,
    LAST,
    LEFT,
    NEARNESS,
    RIGHT,
    ROUNDING,
    ROW,
    SLOPE_X,
    SLOPE_Y,
)


@njit(forceinline=True)
def take_narrow(  # type: ignore[no-untyped-def]
    kind, lanes, nx, parallel, has_depth, weight, prim_id, packed, k, workspace, target
):  # fmt: skip
    """Take the hits of an ordinary triangle, the k-th of its batch and with these corners, in blocks of `lanes` pixels
    in rows of nx, one or two. Blocks begin at even rows, so that none reaches into two bands.

    weight: as for `take`. What lies in the triangle, and how deep, is decided as by `draw_narrow`.
    """
    values, doubles = floats_at(workspace.floats + k * 4), doubles_at(workspace.doubles + k * 8)
    left, right = int(values[LEFT * BATCH]), int(values[RIGHT * BATCH])
    first, last, ny = int(values[FIRST * BATCH]), int(values[LAST * BATCH]), lanes // nx
    above = first % ny
    columns, rows = columns_of(lanes, nx), rows_of(lanes, nx) - splat(np.float32(above), lanes)
    surely, hardly = splat(values[ROUNDING * BATCH], lanes), splat(-values[ROUNDING * BATCH], lanes)
    column0, row0 = splat(values[COLUMN * BATCH], lanes), splat(values[ROW * BATCH], lanes)
    column1, row1 = splat(values[(COLUMN + 1) * BATCH], lanes), splat(values[(ROW + 1) * BATCH], lanes)
    column2, row2 = splat(values[(COLUMN + 2) * BATCH], lanes), splat(values[(ROW + 2) * BATCH], lanes)
    within0 = splat(values[INSIDE * BATCH], lanes) + rows * row0
    within1 = splat(values[(INSIDE + 1) * BATCH], lanes) + rows * row1
    within2 = splat(values[(INSIDE + 2) * BATCH], lanes) + rows * row2
    down = splat(np.float32(ny), lanes)
    below0, below1, below2 = down * row0, down * row1, down * row2
    nothing, one = splat(np.float32(0.0), lanes), splat(np.float32(1.0), lanes)
    slope, cap = splat(values[SLOPE_X * BATCH], lanes), splat(values[CAP * BATCH], lanes)
    slope_y = doubles[SLOPE_Y * BATCH]
    for start in range(left, right + 1, nx):
        along = columns + splat(np.float32(start - left), lanes)
        inside0, inside1, inside2 = within0 + along * column0, within1 + along * column1, within2 + along * column2
        along = along * slope
        pixel, row = (first - above) * target.row + start, doubles[NEARNESS * BATCH] - above * slope_y
        for y in range(first - above, last + 1, ny):
            inside = smaller(smaller(inside0, inside1), inside2)
            taken = inside > hardly
            if rarely(bits_of(taken & (inside <= surely)) != 0):
                exactly = decided(workspace.points, packed, start, y, lanes, nx, workspace.exact)
                taken = taken & mask_of(exactly, lanes)
            depth = nothing
            if has_depth:
                nearness = splat(np.float32(row), lanes)
                if ny == 2:
                    nearness = where(mask_of((1 << nx) - 1, lanes), nearness, splat(np.float32(row + slope_y), lanes))
                found = smaller(cap, nearness + along)
                depth = nothing - found if parallel else one / found
            take(kind, lanes, nx, taken, depth, weight, prim_id, pixel, target)
            inside0, inside1, inside2 = inside0 + below0, inside1 + below1, inside2 + below2
            pixel += ny * target.row
            row += ny * slope_y
