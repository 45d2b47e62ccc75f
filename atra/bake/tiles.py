"""Tiles: squares of texels on flat charts, which for rays of one direction are affine images of each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.bake.charts.texels import Texels
from atra.bake.light.tables import START_OFF
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.view import unit_vector
from atra.kernels.baking.tiles import carry_into_tile
from atra.whole_numbers import is_whole_number

FLAT = 1e-3
"""Of a texel: how far corners of a flat chart may lie off its plane."""

GRAZING = 0.1
"""Cosine below which a shear would lose too many digits."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """K squares of `size` texels.

    origin, across, down: (K, 3) float64, world: of a tile's upper left corner, and a texel's step along row and column.
    normal: (K, 3) float64, unit. texel: (K, size, size) int32, numbers in the list of texels that are lit, -1 where
    another chart or nothing lies.
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
        """Of all texels that are lit, those that tiles have."""
        return float((self.texel >= 0).sum()) / len(self.texels)

    @classmethod
    def of(cls, texels: Texels, size: int = 32, least_texels: int = 1) -> Tiles:
        """The tiles of all flat charts that have so many texels at least: each tile costs a look at the whole mesh.

        Raises InputError for a size or least_texels below 1.
        """
        for name, value in (("size", size), ("least_texels", least_texels)):
            if not is_whole_number(value) or value < 1:
                raise InputError(f"{name} of a tile is {value!r}, expected a whole number of at least 1")
        column, row = texels.number % texels.atlas.width, texels.number // texels.atlas.width
        found = []
        for chart in np.unique(texels.chart):
            plane = _plane(texels, int(chart))
            if plane is None:
                continue
            mine = np.flatnonzero(texels.chart == chart)
            left, top = column[mine].min(), row[mine].min()
            place = np.stack([(row[mine] - top) // size, (column[mine] - left) // size], axis=1)
            for j, i in np.unique(place, axis=0):
                inside = mine[(place == (j, i)).all(axis=1)]
                if len(inside) < least_texels:
                    continue
                first = left + i * size, top + j * size
                of_tile = np.full((size, size), -1, np.int32)
                of_tile[row[inside] - first[1], column[inside] - first[0]] = inside
                found.append((plane.T @ [*first, 1.0], plane[0], plane[1], texels.normals[inside[0]], of_tile))
        if not found:
            none = np.zeros((0, 3))
            return cls(texels, size, none, none, none, none, np.zeros((0, size, size), np.int32))
        origin, across, down, normal, member = (np.array(part) for part in zip(*found, strict=True))
        return cls(texels, size, origin, across, down, normal.astype(np.float64), member)

    @property
    def camera(self) -> OrthographicCamera:
        """Of the reference tile: pixel (x, y) is texel (x, y), and a depth is a length along the direction."""
        return OrthographicCamera((0, 0, 0), (0, 0, 1), (0, -1, 0), float(self.size), self.size, self.size)

    def facing(self, direction: ArrayLike) -> NDArray[np.int64]:
        """Tiles whose rays of this direction leave them, and not too flatly."""
        return np.flatnonzero(self.normal @ unit_vector("direction", direction) >= GRAZING)

    def start(self, tile: int, direction: NDArray[np.float64]) -> float:
        """How far along the unit direction rays start off a tile."""
        bounds = self.texels.mesh.bounds
        return START_OFF * float((bounds[1] - bounds[0]).max()) / float(self.normal[tile] @ direction)

    def mesh_at(self, tile: int, direction: ArrayLike) -> Mesh | None:
        """What rays of this direction from a tile may meet, carried so that they are the rays of `camera`, with their
        parameters kept (paper §3.3); None where there is nothing."""
        way = unit_vector("direction", direction)
        onto = np.linalg.inv(np.column_stack([self.across[tile], self.down[tile], way]))
        mesh = self.texels.mesh
        moved, kept = np.empty(mesh.vertices.shape), np.empty(mesh.triangle_count, np.bool_)
        used = np.zeros(len(mesh.vertices), np.bool_)
        shift = np.array([self.size / 2, self.size / 2, self.start(tile, way)])
        half = self.size / 2 + 0.5
        carry_into_tile(mesh.vertices, mesh.faces, onto, self.origin[tile], shift, half, moved, kept, used)
        if not kept.any():
            return None
        place = np.cumsum(used, dtype=np.uint32) - np.uint32(1)
        return Mesh(moved[used].astype(np.float32), place[mesh.faces[kept]], mesh.name)

    def rays(
        self, tiles: Sequence[int] | NDArray[np.int64], direction: ArrayLike, offset: tuple[float, float]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Origins and directions, (R, 3) float32, of the texels of tiles at a sub-texel offset, tile after tile."""
        way = unit_vector("direction", direction)
        origins = []
        for tile in tiles:
            y, x = np.nonzero(self.texel[tile] >= 0)
            on_tile = np.outer(x + offset[0], self.across[tile]) + np.outer(y + offset[1], self.down[tile])
            origins.append(self.origin[tile] + on_tile + self.start(tile, way) * way)
        whole = np.concatenate(origins).astype(np.float32) if origins else np.zeros((0, 3), np.float32)
        return whole, np.broadcast_to(way.astype(np.float32), whole.shape)


def _plane(texels: Texels, chart: int) -> NDArray[np.float64] | None:
    """(3, 3): the world's point of texel position (x, y) is (x, y, 1) times it; None for a chart that is not flat."""
    faces = np.flatnonzero(texels.atlas.chart == chart)
    uv = texels.atlas.uv[faces].reshape(-1, 2)
    corners = texels.mesh.vertices[texels.mesh.faces[faces]].reshape(-1, 3).astype(np.float64)
    places = np.column_stack([uv, np.ones(len(uv))])
    plane, _, rank, _ = np.linalg.lstsq(places, corners, rcond=None)
    texel = max(np.linalg.norm(plane[0]), np.linalg.norm(plane[1]))
    if rank < 3 or not np.abs(places @ plane - corners).max() <= FLAT * texel:
        return None
    return np.asarray(plane)
