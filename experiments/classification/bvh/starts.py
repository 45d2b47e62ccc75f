"""Shafts: classes of rays that start in one voxel and head for one cell of a cube around it; finding a ray's shaft.

Source: J. Hendrich, A. Pospisil, D. Meister, J. Bittner, "Ray classification for accelerated BVH traversal", 2019; J.
Arvo, D. Kirk, "Fast ray tracing by ray classification", 1987.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.memory import load, store
from atra.compiled.store import njit
from atra.compiled.vectors import floor, larger, signed_like, smaller, splat, where
from experiments.classification.bvh.binary import ROOT
from experiments.classification.bvh.single import FETCHED, FROM_ROOT, PROVEN, SMALLEST_COMPONENT, fetch_node

LANES = 8
"""Rays classified at once."""

AHEAD, AHEAD_ROWS = 16, 8
"""Rays whose shafts are looked up together, before they are traced, which hides memory latency; and rows of a buffer of
these: origins and directions, then voxels and cells."""

MOST = 1 << 24
"""Upper limit of voxels, and of cells of one voxel: kernels number them in float32."""

_ZERO = np.float32(0.0)

UNKNOWN, PASSES = -1, -2
"""Stand in for a voxel: the ray starts too far away to classify, or it misses the box of all voxels."""

ROOT_LIST, EMPTY_LIST, FIRST_LIST = 0, 2, 3
"""Where lists start: the root's, the empty one, and the first of a shaft."""


class Grid(NamedTuple):
    """Voxels of a box, and cells of directions.

    low, high: (3,) float64, corners of the box. size, scale: (3,) float64, sides of a voxel and their inverse. voxels:
    (3,) int64, along each axis. directions: cells along each side of a cube's faces. slack: how much larger voxels are
    taken to be, for rounding. reach: largest coordinate of an origin that can be classified safely.
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
    """The node lists of shafts.

    rows: (voxels,) int32, row of `table`, or UNKNOWN. table: (R, 6 d d) int32, where a shaft's list starts in `lists`.
    lists: uint32, for each list its length and its nodes, the first to visit last. A ray that meets no voxel misses.
    """

    grid: Grid
    rows: NDArray[np.int32]
    table: NDArray[np.int32]
    lists: NDArray[np.uint32]


NO_LISTS = np.array([1, ROOT, 0], np.uint32)
"""The root's list and the empty one."""

NO_SHAFTS = Shafts(
    Grid(np.zeros(3), np.ones(3), np.ones(3), np.ones(3), np.ones(3, np.int64), 1, 0.0, 0.0),
    np.full(1, UNKNOWN, np.int32),
    np.empty((0, 6), np.int32),
    NO_LISTS,
)
"""Stands for shafts where every ray starts at the root."""


@njit(forceinline=True)
def set_ahead(ahead, k, ray):  # type: ignore[no-untyped-def]
    """Write a ray into a column of `ahead`."""
    ahead[0, k], ahead[1, k], ahead[2, k], ahead[3, k], ahead[4, k], ahead[5, k], _ = ray


@njit(forceinline=True)
def _lanes(number):  # type: ignore[no-untyped-def]
    return splat(np.float32(number), LANES)


@njit(forceinline=True)
def _within(place, limit):  # type: ignore[no-untyped-def]
    """Floor of the coordinates, clamped to 0 ... limit - 1."""
    return floor(larger(smaller(place, _lanes(limit - 1)), _lanes(0)))


@njit(forceinline=True)
def _entry(low, high, place, inverse):  # type: ignore[no-untyped-def]
    """Where rays enter and leave the slab between two coordinates."""
    a, b = (_lanes(low) - place) * inverse, (_lanes(high) - place) * inverse
    return smaller(a, b), larger(a, b)


@njit(forceinline=True)
def _inverse(direction):  # type: ignore[no-untyped-def]
    """Reciprocals of direction components; nearly zero ones count as SMALLEST_COMPONENT."""
    least = _lanes(SMALLEST_COMPONENT)
    return _lanes(1) / where(abs(direction) >= least, direction, signed_like(least, direction))


@njit(forceinline=True)
def find_shafts(grid, ahead):  # type: ignore[no-untyped-def]
    """Classify the rays of `ahead`. A ray from outside belongs to the voxel where it enters the box.

    ahead: (AHEAD_ROWS, AHEAD) float32; written: voxel, UNKNOWN or PASSES, and cell.
    """
    low, high, scale, voxels, cells = grid.low, grid.high, grid.scale, grid.voxels, grid.directions
    row, one, two = 4 * AHEAD, _lanes(1), _lanes(2)
    for first in range(0, AHEAD, LANES):
        at = ahead.ctypes.data + 4 * first
        x, y, z = load(at, _ZERO, LANES), load(at + row, _ZERO, LANES), load(at + 2 * row, _ZERO, LANES)
        at += 3 * row
        dx, dy, dz = load(at, _ZERO, LANES), load(at + row, _ZERO, LANES), load(at + 2 * row, _ZERO, LANES)
        at += 3 * row
        across, along, away = _inverse(dx), _inverse(dy), _inverse(dz)
        x0, x1 = _entry(low[0], high[0], x, across)
        y0, y1 = _entry(low[1], high[1], y, along)
        z0, z1 = _entry(low[2], high[2], z, away)
        enters = larger(larger(x0, y0), larger(z0, _lanes(0)))
        passes = enters > smaller(smaller(x1, y1), z1)
        i = _within((x + enters * dx - _lanes(low[0])) * _lanes(scale[0]), voxels[0])
        j = _within((y + enters * dy - _lanes(low[1])) * _lanes(scale[1]), voxels[1])
        k = _within((z + enters * dz - _lanes(low[2])) * _lanes(scale[2]), voxels[2])
        voxel = where(passes, _lanes(PASSES), (k * _lanes(voxels[1]) + j) * _lanes(voxels[0]) + i)
        too_far = larger(larger(abs(x), abs(y)), abs(z)) > _lanes(grid.reach)
        store(where(too_far, _lanes(UNKNOWN), voxel), at)
        most = abs(dy) > abs(dx)
        heading, inverse, face = where(most, dy, dx), where(most, along, across), where(most, two, _lanes(0))
        u, v = where(most, dz, dy), where(most, dx, dz)
        most = abs(dz) > abs(heading)
        heading, inverse, face = where(most, dz, heading), where(most, away, inverse), where(most, two + two, face)
        u, v = where(most, dx, u), where(most, dy, v)
        face = where(heading >= _lanes(0), face, face + one)
        inverse, half = abs(inverse), _lanes(0.5 * cells)
        column, line = _within((u * inverse + one) * half, cells), _within((v * inverse + one) * half, cells)
        store((face * _lanes(cells) + line) * _lanes(cells) + column, at + row)


@njit(forceinline=True)
def number_of(grid, ahead, k):  # type: ignore[no-untyped-def]
    """The shaft number of a column of `ahead`, or UNKNOWN or PASSES."""
    voxel, cell = np.int64(ahead[6, k]), np.int64(ahead[7, k])
    return np.int64(voxel * 6 * grid.directions * grid.directions + cell if voxel >= 0 else voxel)


@njit(forceinline=True)
def list_of(shafts, ahead, k):  # type: ignore[no-untyped-def]
    """Where the list for a column of `ahead` starts."""
    voxel, cell = np.int64(ahead[6, k]), np.int64(ahead[7, k])
    if voxel < 0:
        return np.int64(EMPTY_LIST if voxel == PASSES else ROOT_LIST)
    row = shafts.rows[voxel]
    return np.int64(shafts.table[row, cell] if row >= 0 else ROOT_LIST)


@njit(forceinline=True)
def fetch_list(tree, lists, start):  # type: ignore[no-untyped-def]
    """Prefetch the nodes of a list that are visited first."""
    length = np.int64(lists[start])
    for k in range(max(length - FETCHED, 0), length):
        fetch_node(tree, lists[start + 1 + k])


@njit(forceinline=True)
def count_start(start, counts):  # type: ignore[no-untyped-def]
    """Count rays that start at the root or at the empty list."""
    if start == ROOT_LIST:
        counts[FROM_ROOT] += 1
    elif start == EMPTY_LIST:
        counts[PROVEN] += 1
