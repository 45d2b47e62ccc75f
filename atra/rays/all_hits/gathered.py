"""All hits of rays reduced to a number or a few."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Count, Layers, Reduction, Thickness, Transmittance, check_reduction
from atra.errors import InputError
from atra.prim_ids import MISS
from atra.rays.all_hits.finding import MOST, HitFinder, Progress
from atra.rays.all_hits.lists import RayHitLists
from atra.rays.geometries import Geometries
from atra.rays.rays import Rays

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
