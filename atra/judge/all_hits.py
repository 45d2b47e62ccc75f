"""All hits before the oracle: whether what was gathered is what float64 finds, testing every triangle of every ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.results import Counts, LayerHits, Thicknesses
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.intersection import intersect_pixels, triangles_in_camera_space
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.judge.all_hits_kernels import judge_rays
from atra.prim_ids import MISS

TOLERANCE = 1e-5
"""Of a thickness, relative to itself; and of depths, up to which float32 may put either in front."""

ROUNDINGS = 4.0 * 2.0**-24
"""Four roundings in float32 of the products that a depth is made of."""


@dataclass(frozen=True, eq=False)
class AllHits:
    """What the ray of every pixel meets, by volumes in float64.

    least, most: (H, W) int64, how many triangles it crosses: without and with those that float64 cannot decide about.
    nearer: (H, W) int64, of the least, those nearer than the limit. thickness: (H, W) float64, where both are equal;
    products: (H, W) float64, of the depths it consists of, what their roundings are relative to.
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
    """The truth of every pixel. limits: (H, W) depths. Takes some ten nanoseconds a ray and triangle.

    Raises InputError for a bad offset or thread count.
    """
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


def wrong_counts(counts: Counts, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, where a count is none that float64 allows."""
    truth = all_hits(counts.mesh, counts.camera, counts.offset, threads=threads)
    return (counts.count < truth.least) | (counts.count > truth.most)


def wrong_thicknesses(found: Thicknesses, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, where a thickness is farther off than TOLERANCE of itself and ROUNDINGS of its depths; nowhere that
    float64 cannot decide what is hit."""
    truth = all_hits(found.mesh, found.camera, found.offset, threads=threads)
    allowed = TOLERANCE * truth.thickness + ROUNDINGS * truth.products
    return (truth.least == truth.most) & ~(np.abs(found.thickness - truth.thickness) <= allowed)


def wrong_layers(found: LayerHits, threads: int | None = 1) -> NDArray[np.bool_]:
    """(H, W) bool, where layers are not the nearest hits, each once, at their depths and in their order, or where
    `count` is none that float64 allows."""
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
