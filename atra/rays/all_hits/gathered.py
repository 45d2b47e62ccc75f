"""All hits of rays as lists, and reduced to a number or a few."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Count, Layers, Reduction, Thickness, Transmittance, check_reduction
from atra.errors import InputError
from atra.geometry.mesh import Mesh, unit_normals
from atra.prim_ids import MISS
from atra.rays.geometries import Geometries
from atra.rays.rays import Rays
from atra.rays.tree.finding import MOST, HitFinder, Progress


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


_RAYS = 1 << 18
"""Rays whose hits are reduced at a time, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class RayLayers:
    """The k nearest hits of every ray, sorted by t; `...` is the leading shape of the rays.

    Attributes
    ----------
    t : (k, ...) float32
        In lengths of the direction, inf = no hit.
    prim_id, geometry_id : (k, ...) uint32
        `MISS` = no hit.
    count : (...) uint32
        The number of all hits.
    """

    t: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    geometry_id: NDArray[np.uint32]
    count: NDArray[np.uint32]


def gathered(
    what: Reduction,
    rays: Rays,
    shape: tuple[int, ...],
    finder: HitFinder,
    geometries: Geometries,
    progress: Progress | None,
) -> NDArray | RayLayers:
    """What `RayScene.gather` says, of rays around the mesh's origin, and of their leading shape."""
    check_reduction(what)
    weights = None
    if not isinstance(what, Thickness):
        weights = what.weights(geometries.mesh)
    elif geometries.met is not None:
        what.weights(geometries.met)

    def in_parts(reduce: Callable[[Rays], tuple[NDArray, ...]]) -> list[NDArray]:
        parts = []
        for start in range(0, max(len(rays), 1), _RAYS):
            parts.append(reduce(_some(rays, slice(start, start + _RAYS))))
            if progress is not None:
                progress(min(start + _RAYS, len(rays)), len(rays))
        return [np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)]

    match what:
        case Count():
            return finder.count(rays, progress).astype(np.uint32).reshape(shape)
        case Thickness():
            return in_parts(lambda some: (_thickness(some, finder, geometries),))[0].reshape(shape)
        case Transmittance():
            assert weights is not None
            return in_parts(lambda some: (_transmittance(some, finder, weights),))[0].reshape(shape)
        case Layers():
            t, traced_id, count = in_parts(lambda some: _layers(some, finder, what.k))
            layered = what.k, *shape
            prim_id, geometry_id = geometries.own_ids(traced_id), geometries.geometry_ids(traced_id)
            ids = prim_id.reshape(layered), geometry_id.reshape(layered)
            return RayLayers(t.reshape(layered), *ids, count.reshape(shape))
    raise InputError(f"cannot gather {what!r:.100}")


def _some(rays: Rays, which: slice) -> Rays:
    return Rays(rays.origins[which], rays.directions[which], rays.tnear[which], rays.tfar[which])


def _thickness(rays: Rays, finder: HitFinder, geometries: Geometries) -> NDArray[np.float32]:
    """Every crossing counts with the part of the interval before it, which is right for rays that start or end inside,
    too: so the rays go on to infinity."""
    open_rays = Rays(rays.origins, rays.directions, rays.tnear)
    found = RayHitLists(*finder.find(open_rays), (len(rays),), open_rays, geometries)
    before = np.minimum(found.t, rays.tfar[found.ray_ids].astype(np.float64)) - rays.tnear[found.ray_ids]
    inside = np.bincount(found.ray_ids, np.where(found.leaving, before, -before), len(rays))
    return np.where(rays.tfar > rays.tnear, inside, 0.0).astype(np.float32)


def _transmittance(rays: Rays, finder: HitFinder, weights: NDArray[np.float32]) -> NDArray[np.float32]:
    found = finder.find(rays)
    product, counts = np.ones(len(rays)), np.diff(found.ray_splits)
    has_hits = counts > 0
    factors = weights[found.prim_id].astype(np.float64)
    if has_hits.any():
        product[has_hits] = np.multiply.reduceat(factors, found.ray_splits[:-1][has_hits])
    return product.astype(np.float32)


def _layers(rays: Rays, finder: HitFinder, k: int) -> tuple[NDArray, ...]:
    found = finder.find(rays, min(k, MOST))
    counts = np.diff(found.ray_splits)
    ray_ids = np.repeat(np.arange(len(rays)), counts)
    layer = np.arange(len(found.t)) - np.repeat(found.ray_splits[:-1], counts)
    t, traced_id = np.full((k, len(rays)), np.inf, np.float32), np.full((k, len(rays)), MISS)
    t[layer, ray_ids], traced_id[layer, ray_ids] = found.t, found.prim_id
    return t, traced_id, finder.count(rays).astype(np.uint32)
