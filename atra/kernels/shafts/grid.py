"""Shafts: rays that start in one voxel and head for one cell of a cube around it, and which shaft a ray is in.

Source: J. Hendrich, A. Pospisil, D. Meister, J. Bittner, "Ray classification for accelerated BVH traversal", 2019;
J. Arvo, D. Kirk, "Fast ray tracing by ray classification", 1987.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.kernels.bvh.layout import ROOT
from atra.kernels.bvh.single import FROM_ROOT, LISTED, PROVEN

UNKNOWN, PASSES = -1, -2
"""In place of a shaft: the ray starts too far away to tell, or it passes the box of all shafts. In place of a list:
there is none, or nothing can be hit."""


class Grid(NamedTuple):
    """Voxels of a box, and cells of directions.

    low, high: (3,) float64, the box's corners. size, scale: (3,) float64, sides of a voxel, and their inverse. voxels:
    (3,) int64 along each axis. directions: cells along each side of a cube's six faces. slack: by how much voxels are
    larger than they are, for rounding. reach: largest coordinate of an origin that can be told, whose roundings are far
    smaller than that.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    size: NDArray[np.float64]
    scale: NDArray[np.float64]
    voxels: NDArray[np.int64]
    directions: int
    slack: float
    reach: float


class Shafts(NamedTuple):
    """Lists of shafts, as a traversal looks them up.

    rows: (voxels,) int32, row of `table`, or UNKNOWN. table: (R, 6 d d) int32, where a list begins in `lists`, or
    UNKNOWN. lists: uint32, of each list its length and its nodes, the last of which comes first. empty_is_miss: whether
    an empty list proves that nothing is hit; otherwise the ray starts from the root.
    """

    grid: Grid
    rows: NDArray[np.int32]
    table: NDArray[np.int32]
    lists: NDArray[np.uint32]
    empty_is_miss: bool


NO_SHAFTS = Shafts(
    Grid(np.zeros(3), np.ones(3), np.ones(3), np.ones(3), np.ones(3, np.int64), 1, 0.0, 0.0),
    np.full(1, UNKNOWN, np.int32),
    np.empty((0, 6), np.int32),
    np.empty(0, np.uint32),
    True,
)
"""In place of shafts where every ray starts from the root."""


@njit(inline="always")
def _clip(place, direction, low, high, t0, t1):  # type: ignore[no-untyped-def]
    """The part of [t0, t1] in which a coordinate lies between low and high."""
    if direction == 0.0:
        return (t0, t1) if low <= place <= high else (t0, t0 - 1.0)
    inverse = 1.0 / direction
    a, b = (low - place) * inverse, (high - place) * inverse
    return max(t0, min(a, b)), min(t1, max(a, b))


@njit(inline="always")
def _cell(place, cells):  # type: ignore[no-untyped-def]
    return min(max(int(place), 0), cells - 1)


@njit(inline="always")
def shaft_of(grid, ray):  # type: ignore[no-untyped-def]
    """The number of a ray's shaft, UNKNOWN or PASSES; in float64. A ray from outside belongs where it enters the
    box."""
    x, y, z = np.float64(ray[0]), np.float64(ray[1]), np.float64(ray[2])
    dx, dy, dz = np.float64(ray[3]), np.float64(ray[4]), np.float64(ray[5])
    if max(abs(x), abs(y), abs(z)) > grid.reach:
        return UNKNOWN
    low, high, scale, voxels = grid.low, grid.high, grid.scale, grid.voxels
    inside = low[0] <= x <= high[0] and low[1] <= y <= high[1] and low[2] <= z <= high[2]
    if not inside:
        t0, t1 = _clip(x, dx, low[0], high[0], 0.0, np.inf)
        t0, t1 = _clip(y, dy, low[1], high[1], t0, t1)
        t0, t1 = _clip(z, dz, low[2], high[2], t0, t1)
        if t0 > t1:
            return PASSES
        x, y, z = x + t0 * dx, y + t0 * dy, z + t0 * dz
    i, j = _cell((x - low[0]) * scale[0], voxels[0]), _cell((y - low[1]) * scale[1], voxels[1])
    k = _cell((z - low[2]) * scale[2], voxels[2])
    ax, ay, az = abs(dx), abs(dy), abs(dz)
    if ax >= ay and ax >= az:
        face, u, v, along = (1 if dx < 0 else 0), dy, dz, ax
    elif ay >= az:
        face, u, v, along = (3 if dy < 0 else 2), dz, dx, ay
    else:
        face, u, v, along = (5 if dz < 0 else 4), dx, dy, az
    along = 1.0 / along
    u, v = u * along, v * along
    cells = grid.directions
    column, row = _cell((u + 1.0) * 0.5 * cells, cells), _cell((v + 1.0) * 0.5 * cells, cells)
    voxel = (k * voxels[1] + j) * voxels[0] + i
    return ((voxel * 6 + face) * cells + row) * cells + column


@njit(inline="always")
def list_of(shafts, number):  # type: ignore[no-untyped-def]
    """Where the list of a shaft begins, UNKNOWN where there is none, PASSES where nothing can be hit."""
    if number < 0:
        return number if shafts.empty_is_miss else UNKNOWN
    of_voxel = 6 * shafts.grid.directions * shafts.grid.directions
    row = shafts.rows[number // of_voxel]
    start = shafts.table[row, number % of_voxel] if row >= 0 else np.int32(UNKNOWN)
    if start >= 0 and shafts.lists[start] == 0:
        return PASSES if shafts.empty_is_miss else UNKNOWN
    return np.int64(start)


@njit(inline="always")
def push_list(shafts, start, stack, counting, counts):  # type: ignore[no-untyped-def]
    """Put the nodes of a list (`list_of`) on an empty stack, or the root; returns how many there are."""
    if start == UNKNOWN:
        stack[0] = ROOT
        if counting:
            counts[FROM_ROOT] += 1
        return 1
    if start == PASSES:
        if counting:
            counts[PROVEN] += 1
        return 0
    length = np.int64(shafts.lists[start])
    for k in range(length):
        stack[k] = shafts.lists[start + 1 + k]
    if counting:
        counts[LISTED] += length
    return length
