"""The lists of all hits of rays, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh, unit_normals
from atra.rays.geometries import Geometries
from atra.rays.rays import Rays


@dataclass(frozen=True, eq=False)
class RayHitLists:
    """All hits of every ray of a batch, each crossing once, one ray after the other and sorted along each.

    Attributes
    ----------
    ray_splits : (N + 1,) int64
        The hits of ray i are those from ray_splits[i] up to ray_splits[i + 1].
    t : (M,) float64
        In lengths of the ray's direction. Hits of one t are sorted by geometry_id and prim_id.
    u, v : (M,) float32
        Barycentric weights of the triangle's second and third vertex.
    truncated : (N,) bool
        The ray has more hits than `max_hits`; those kept are its nearest.
    shape
        Leading shape of the rays as given; rays are counted flat, in C order.
    rays, mesh
        What was traced; several meshes are joined to one, in which `traced_id` counts.
    """

    ray_splits: NDArray[np.int64]
    t: NDArray[np.float64]
    traced_id: NDArray[np.uint32] = field(repr=False)
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    truncated: NDArray[np.bool_]
    shape: tuple[int, ...]
    rays: Rays = field(repr=False)
    geometries: Geometries = field(repr=False)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def mesh(self) -> Mesh:
        return self.geometries.mesh

    @cached_property
    def prim_id(self) -> NDArray[np.uint32]:
        """(M,) uint32, in the numbering of the hit's own mesh."""
        return self.geometries.own_ids(self.traced_id)

    @cached_property
    def geometry_id(self) -> NDArray[np.uint32]:
        """(M,) uint32, which of the scene's meshes is hit."""
        return self.geometries.geometry_ids(self.traced_id)

    @property
    def counts(self) -> NDArray[np.uint32]:
        """The number of hits of every ray, in the rays' own shape."""
        return np.diff(self.ray_splits).astype(np.uint32).reshape(self.shape)

    @cached_property
    def ray_ids(self) -> NDArray[np.int64]:
        """(M,) int64, the ray of every hit."""
        return np.repeat(np.arange(len(self.ray_splits) - 1), np.diff(self.ray_splits))

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(M, 3) float64, places of the hits on their rays, scene units."""
        directions = self.rays.directions[self.ray_ids].astype(np.float64)
        return self.rays.origins[self.ray_ids] + self.t[:, None] * directions

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """(M, 3) float64, unit normals of the triangles, towards where their corners are counterclockwise."""
        return unit_normals(self.mesh, self.traced_id)

    @property
    def leaving(self) -> NDArray[np.bool_]:
        """(M,) bool, the ray crosses the triangle from its back to its front, as where it leaves a closed mesh."""
        directions = self.rays.directions[self.ray_ids].astype(np.float64)
        corners = self.mesh.triangles(self.traced_id)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.asarray((normals * directions).sum(axis=1) > 0.0)
