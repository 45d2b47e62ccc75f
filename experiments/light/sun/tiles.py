"""Tiles of texels on flat charts; for rays of one direction they are affine images of each other."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.view import unit_vector
from atra.light.checks import check_whole
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.priority import start_off
from atra.prim_ids import MISS
from experiments.classification.bvh.binary import bvh_of
from experiments.light.sun.rays import TileRays, tile_rays
from experiments.light.sun.tiles_kernels import BoxTree, Prisms

FLAT = 1e-3
"""Largest distance of a flat chart's corners from its plane, in texels."""

GRAZING = 0.1
"""Smallest cosine of direction and normal; below, a shear would lose too many digits."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """K squares of `size` texels.

    origin: (K, 3) float64, a tile's upper left corner, around the mesh's origin. across, down: (K, 3) float64, a
    texel's step along row and column. normal: (K, 3) float64, unit. texel: (K, size, size) int32, numbers in `texels`,
    -1 where another chart or nothing lies.
    """

    texels: Texels
    size: int
    origin: NDArray[np.float64]
    across: NDArray[np.float64]
    down: NDArray[np.float64]
    normal: NDArray[np.float64]
    texel: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.origin)

    @property
    def texel_share(self) -> float:
        """The fraction of all texels that lie in tiles."""
        return float((self.texel >= 0).sum()) / len(self.texels)

    @classmethod
    def of(cls, texels: Texels, size: int = 8, least_texels: int = 1) -> Tiles:
        """The tiles with at least `least_texels` texels, on all flat charts.

        Raises InputError for a size or least_texels below 1.
        """
        for name, value in (("size", size), ("least_texels", least_texels)):
            check_whole(f"{name} of a tile", value, 1)
        atlas = texels.atlas
        column, row = texels.number % atlas.width, texels.number // atlas.width
        charts, number = np.unique(texels.chart, return_inverse=True)
        left, top = np.full(len(charts), atlas.width), np.full(len(charts), atlas.height)
        np.minimum.at(left, number, column)
        np.minimum.at(top, number, row)
        i, j = (column - left[number]) // size, (row - top[number]) // size
        most = int(max(i.max(initial=0), j.max(initial=0))) + 1
        _, one, tile, count = np.unique(
            (number * most + j) * most + i, return_index=True, return_inverse=True, return_counts=True
        )
        planes = _planes(texels, charts)
        wanted = np.flatnonzero((count >= least_texels) & np.isfinite(planes[number[one], 0, 0]))
        one, plane = one[wanted], planes[number[one[wanted]]]
        first = np.stack([left[number[one]] + i[one] * size, top[number[one]] + j[one] * size], axis=1)
        place = np.full(len(count), -1)
        place[wanted] = np.arange(len(wanted))
        inside = np.flatnonzero(place[tile] >= 0)
        own = place[tile[inside]]
        member = np.full((len(wanted), size, size), -1, np.int32)
        member[own, row[inside] - first[own, 1], column[inside] - first[own, 0]] = inside
        origin = first[:, :1] * plane[:, 0] + first[:, 1:] * plane[:, 1] + plane[:, 2]
        return cls(texels, size, origin, plane[:, 0], plane[:, 1], texels.normals[one].astype(np.float64), member)

    def facing(self, direction: ArrayLike) -> NDArray[np.int64]:
        """Tiles whose rays of this direction leave them, and not too flatly."""
        return np.flatnonzero(self.normal @ unit_vector("direction", direction) >= GRAZING)

    @cached_property
    def tree(self) -> BoxTree:
        """The mesh, for rays of any direction; made once."""
        mesh = self.texels.mesh.local
        bvh = bvh_of(mesh, mesh.vertices, WorkerPool(1))
        prim_ids = np.where(bvh.is_left_over, MISS, bvh.blocks[:, 9])
        corners = bvh.blocks.view(np.float32).copy()
        corners[:, 3:6] -= corners[:, :3]  # edges
        corners[:, 6:9] -= corners[:, :3]
        x, y, z = (bvh.boxes[:, 1] - bvh.boxes[:, 0]).T
        area, inner = x * y + y * z + z * x, np.flatnonzero(bvh.block_counts == 0)
        inner = inner[inner != 1]  # node 1 is unused
        larger = np.zeros(len(area), np.uint8)
        larger[inner] = area[bvh.first[inner] + 1] > area[bvh.first[inner]]
        return BoxTree(
            bvh.boxes, bvh.first, bvh.block_counts, larger, corners, prim_ids, mesh.vertices, mesh.traced_faces
        )

    @cached_property
    def _rectangles(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(K, 2) float64 each: centre, relative to the tile's, and half sides of the rectangle of a tile's texels."""
        lit = self.texel >= 0
        filled = np.stack([lit.any(axis=1), lit.any(axis=2)], axis=1)
        low, high = filled.argmax(axis=2) - self.size / 2, self.size / 2 - filled[:, :, ::-1].argmax(axis=2)
        return (low + high) / 2, (high - low) / 2

    def starts(self, tiles: NDArray[np.int64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far along the unit direction rays start off tiles."""
        return start_off(self.texels.mesh) / (self.normal[tiles] @ direction)

    def prisms(self, tiles: NDArray[np.int64], direction: ArrayLike) -> Prisms:
        """The maps that carry rays of this direction from tiles onto those of `TileRays`, parameters kept (paper
        §3.3)."""
        way = unit_vector("direction", direction)
        axes = np.stack([self.across[tiles], self.down[tiles], np.broadcast_to(way, (len(tiles), 3))], axis=2)
        onto, off = np.linalg.inv(axes).astype(np.float64), self.starts(tiles, way)
        shift = (onto @ self.origin[tiles, :, None])[..., 0]
        shift[:, :2] += self.size / 2
        shift[:, 2] += off
        middle, half = self._rectangles
        return Prisms(onto, shift, off, middle[tiles], half[tiles])

    def towards(
        self, tiles: NDArray[np.int64], direction: ArrayLike, shortcut: bool = True, **options: Any
    ) -> AbstractContextManager[TileRays]:
        """`tile_rays` of this direction from tiles, with its options. Without the shortcut no triangle covers part of a
        tile; whether one does is still asked."""
        prisms = self.prisms(tiles, direction)
        if not shortcut:
            prisms = prisms._replace(off=np.full_like(prisms.off, np.inf))  # no ray starts surely before one
        return tile_rays(self.tree, prisms, self.size, **options)

    def rays(
        self, tiles: NDArray[np.int64], direction: ArrayLike, offset: tuple[float, float]
    ) -> tuple[NDArray[np.floating], NDArray[np.float32]]:
        """Origins and directions, (R, 3) float32, of the texels of tiles at a sub-texel offset, tile by tile, in world
        space; origins are float64 for a mesh with an origin."""
        way = unit_vector("direction", direction)
        k, y, x = np.nonzero(self.texel[tiles] >= 0)
        own, off = tiles[k], self.starts(tiles, way)[k]
        origins = self.origin[own] + off[:, None] * way
        origins += (x + offset[0])[:, None] * self.across[own] + (y + offset[1])[:, None] * self.down[own]
        ways = np.broadcast_to(way.astype(np.float32), origins.shape)
        mesh = self.texels.mesh
        return (origins + mesh.origin if mesh.has_origin else origins.astype(np.float32)), ways


def _planes(texels: Texels, charts: NDArray[np.int32]) -> NDArray[np.float64]:
    """(C, 3, 3): maps of texel positions (x, y, 1) to points around the mesh's origin; NaN for charts not flat."""
    planes = np.full((len(charts), 3, 3), np.nan)
    order = np.argsort(texels.atlas.chart, kind="stable")
    starts, stops = (np.searchsorted(texels.atlas.chart[order], charts, side) for side in ("left", "right"))
    for chart, (start, stop) in enumerate(zip(starts, stops, strict=True)):
        faces = order[start:stop]
        uv = texels.atlas.uv[faces].reshape(-1, 2)
        corners = texels.mesh.local_vertices[texels.mesh.faces[faces]].reshape(-1, 3).astype(np.float64)
        places = np.column_stack([uv, np.ones(len(uv))])
        plane, _, rank, _ = np.linalg.lstsq(places, corners, rcond=None)
        texel = max(np.linalg.norm(plane[0]), np.linalg.norm(plane[1]))
        if rank == 3 and np.abs(places @ plane - corners).max() <= FLAT * texel:
            planes[chart] = plane
    return planes
