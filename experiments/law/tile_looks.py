"""A look at some tiles: what rays of one direction from them meet, and what is copied for them."""

from __future__ import annotations

from dataclasses import dataclass
from math import log2

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.view import unit_vector
from experiments.law.model.copying import spread
from experiments.law.model.counting_kernels import RAYS, SIDE
from experiments.law.model.looking import MOST_IN_TREE, means_along
from experiments.law.model.looking_kernels import LEVELS
from experiments.light.sun.tiles import Tiles, without_shortcut
from experiments.light.sun.tiles_kernels import SIDE as BLOCKS
from experiments.light.sun.tiles_kernels import find_triangles

MOST_TILES = 64
"""Tiles that are looked at."""

_ALL = BLOCKS * BLOCKS

_STEPS = tuple(1 << k for k in range(SIDE.bit_length()))
_SHAPES = tuple((across, down) for across in _STEPS for down in _STEPS if down <= across)


@dataclass(frozen=True, eq=False)
class TileLook:
    """What the model knows of rays of one direction from tiles.

    tiles: those that face the direction. size: texels along a side of one. texels: those that are lit, in all of these
    tiles. boxes, tested, met: means over packets of each of `shapes`, as in `Look` of the law; a shape is
    columns and rows of rays, of which SIDE lie along a side of a tile. copies: triangles copied for all tiles.
    open_share: share of a tile's area that no single triangle covers.
    """

    tiles: int
    size: int
    texels: int
    boxes: NDArray[np.float64]
    tested: NDArray[np.float64]
    met: NDArray[np.float64]
    copies: float
    open_share: float

    @property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        return _SHAPES

    def shape_of(self, across: int, down: int) -> int:
        """The place in `shapes` of packets so many texels wide and high."""
        wide, high = sorted((self._rays(across), self._rays(down)), reverse=True)
        return _SHAPES.index((wide, high))

    def _rays(self, texels: int) -> int:
        return 1 << min(max(round(log2(texels * SIDE / self.size)), 0), SIDE.bit_length() - 1)


def look_at_tiles(tiles: Tiles, direction: ArrayLike, shortcut: bool = True) -> TileLook:
    """Look at rays of this direction from tiles, on one thread.

    shortcut: whether rays that one triangle surely shadows are not traced. Raises InputError for a direction that is no
    vector, or 0.
    """
    way = unit_vector("direction", direction)
    facing = tiles.facing(way)
    texels = int((tiles.texel[facing] >= 0).sum())
    faces = tiles.texels.mesh.traced_faces
    if not len(facing) or not len(faces):
        none = np.zeros((len(_SHAPES), 2))
        return TileLook(len(facing), tiles.size, texels, np.zeros((*none.shape, LEVELS)), none, none, 0.0, 1.0)
    some = facing[spread(np.arange(len(facing)), MOST_TILES)]
    copies, open_share = _copied(tiles, some, way, shortcut)
    counted = _counted(tiles, some, way, faces)
    return TileLook(len(facing), tiles.size, texels, *counted, copies * len(facing) / len(some), open_share)


def _copied(tiles: Tiles, some: NDArray[np.int64], way: NDArray[np.float64], shortcut: bool) -> tuple[float, float]:
    """Copies for these tiles, and the share of their blocks that no triangle covers."""
    prisms, faces = tiles.prisms(some, way), len(tiles.tree.faces)
    if not shortcut:
        prisms = without_shortcut(prisms)
    total, starts, counts = np.zeros(1, np.int64), *np.empty((2, len(some)), np.int64)
    covered, kept = np.empty(len(some), np.uint64), np.empty(0, np.uint32)
    found = np.empty(faces, np.uint32), np.empty(faces, np.uint64)
    pool = WorkerPool(1)
    pool.run(
        lambda _, counter: find_triangles(
            counter, total.ctypes.data, tiles.tree, prisms, *found, kept, starts, counts, covered
        )
    )
    pool.close()
    bits = sum(int(word).bit_count() for word in covered)
    return float(counts.sum()), 1.0 - bits / (_ALL * len(some))


def _counted(
    tiles: Tiles, some: NDArray[np.int64], way: NDArray[np.float64], faces: NDArray[np.integer]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """boxes, tested and met of `TileLook`."""
    places = (np.arange(SIDE) + 0.5) * tiles.size / SIDE
    origins = (tiles.origin[some] + tiles.starts(some, way)[:, None] * way)[:, None, None]
    origins = origins + places[:, None] * tiles.across[some][:, None, None]
    origins = origins + places[:, None, None] * tiles.down[some][:, None, None]
    rays = np.empty((len(some), 6, RAYS), np.float32)
    rays[:, :3] = origins.reshape(len(some), RAYS, 3).transpose(0, 2, 1)
    rays[:, 3:] = way.astype(np.float32)[:, None]
    few, points = faces[spread(np.arange(len(faces)), MOST_IN_TREE)], tiles.texels.mesh.local_vertices
    nearest = np.full((len(some), RAYS), np.inf, np.float32)
    pool = WorkerPool(1)
    means_along(points, few, len(faces), rays, nearest.copy(), _SHAPES[:1], pool, nearest)
    counted = means_along(points, few, len(faces), rays, nearest, _SHAPES, pool)
    pool.close()
    return counted
