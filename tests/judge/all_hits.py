"""Judging reductions of all hits: they are compared with tests of every ray and triangle in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.results import CountResult, LayersResult, ThicknessResult
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.intersection import intersect_pixels, triangles_in_camera_space
from atra.exact.rounding import ROUNDINGS
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.prim_ids import MISS
from tests.judge.all_hits_kernels import judge_rays

TOLERANCE = 1e-5
"""Relative error allowed of a thickness, and relative difference of depths that float32 may order either way."""


@dataclass(frozen=True, eq=False)
class AllHits:
    """The crossings of every pixel's ray in float64.

    least, most: (H, W) int64, number of triangles crossed, without and with those that float64 cannot decide.
    nearer: (H, W) int64, number of sure crossings nearer than the limit.
    thickness: (H, W) float64, valid where least = most.
    products: (H, W) float64, sum of the products to which the depths' roundings are relative.
    """

    least: NDArray[np.int64]
    most: NDArray[np.int64]
    nearer: NDArray[np.int64]
    thickness: NDArray[np.float64]
    products: NDArray[np.float64]


def all_hits(
    mesh: Mesh,
    camera: View,
    offset: tuple[float, float] = (0.5, 0.5),
    limits: NDArray[np.floating] | float = np.inf,
    threads: int | None = 1,
) -> AllHits:
    """All crossings of every pixel's ray, by testing all triangles. limits: (H, W) depths.

    Raises InputError for a bad offset or thread count.
    """
    mesh, camera = own_space(mesh, camera)
    shape = camera.height, camera.width
    rows, columns = np.indices(shape)
    rays = [part.reshape(-1, 3) for part in np.broadcast_arrays(*camera.rays(columns, rows, offset))]
    origins, directions = (np.ascontiguousarray(part, np.float64) for part in rays)
    geometry = triangles_in_camera_space(mesh, camera, np.arange(mesh.triangle_count))
    limits = np.ascontiguousarray(np.broadcast_to(limits, shape), np.float64).reshape(-1)
    sure, unsure, nearer = (np.empty(len(directions), np.int64) for _ in range(3))
    thickness, products = np.empty(len(directions)), np.empty(len(directions))
    pool = WorkerPool(resolve_threads(threads))
    out = limits, sure, unsure, nearer, thickness, products
    try:
        pool.run(lambda _, counter: judge_rays(counter, origins, directions, *geometry, *out))
    finally:
        pool.close()
    least, most = sure.reshape(shape), (sure + unsure).reshape(shape)
    return AllHits(least, most, nearer.reshape(shape), thickness.reshape(shape), products.reshape(shape))


def wrong_counts(counts: CountResult, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, whether float64 excludes a count."""
    truth = all_hits(counts.mesh, counts.camera, counts.offset, threads=threads)
    return (counts.count < truth.least) | (counts.count > truth.most)


def wrong_thicknesses(found: ThicknessResult, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, whether a thickness errs by more than allowed; False where float64 cannot decide what is hit."""
    truth = all_hits(found.mesh, found.camera, found.offset, threads=threads)
    allowed = TOLERANCE * truth.thickness + ROUNDINGS * truth.products
    return (truth.least == truth.most) & ~(np.abs(found.thickness - truth.thickness) <= allowed)


def wrong_layers(found: LayersResult, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, whether layers are not the nearest hits in order, each once, or float64 excludes their `count`."""
    depth, prim_id = found.depth.astype(np.float64), found.prim_id
    given = prim_id != MISS
    full = given.all(axis=0)
    limits = np.where(full, depth[-1], np.inf) * (1.0 - TOLERANCE)
    truth = all_hits(found.mesh, found.camera, found.offset, limits, threads)
    layers = np.minimum(found.count, len(depth))
    wrong = (given.sum(axis=0) != layers) | (found.count < truth.least) | (found.count > truth.most)
    wrong |= (given != np.isfinite(depth)).any(axis=0) | (given[1:] & ~given[:-1]).any(axis=0)
    wrong |= (given[1:] & (depth[1:] < depth[:-1])).any(axis=0)
    wrong |= truth.nearer > layers - full
    ordered = np.sort(prim_id, axis=0)
    wrong |= ((ordered[1:] == ordered[:-1]) & (ordered[1:] != MISS)).any(axis=0)
    y, x = np.nonzero(given)[1:]
    met = intersect_pixels(found.mesh, found.camera, x, y, prim_id[given], found.offset)
    far = np.abs(found.camera.to_camera_space(found.mesh.vertices)).max()
    off = np.abs(met.depth - depth[given]) > TOLERANCE * met.depth + ROUNDINGS * far
    beside = met.edge_distance < -TOLERANCE
    wrong[y[off | beside], x[off | beside]] = True
    return wrong
