"""The oracle: the nearest hit of a ray in float64, and which of two images that disagree is wrong.

`compare` decides whether float32 excuses a difference. The oracle excuses nothing: it finds the nearest triangle by
testing all, and an image names it, one at the same depth, or neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import FLOAT64_TOLERANCE, Pairs
from atra.exact.ties import TIE_TOLERANCE
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import Agreement, Verdict, compare
from atra.prim_ids import MISS
from experiments.workloads.brute_force import near_pairs, nearest_of

EXHAUSTIVE_TESTS = 2e10
"""Rays times triangles up to which `examine` tests all triangles. Images that disagree in more pixels are broken, and
the nearer one of their two answers then counts as the truth."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The nearest hit of N rays.

    prim_id: (N,) uint32, the lowest one of triangles at the same depth; MISS = miss.
    depth: (N,) float64, scene units; inf = miss.
    """

    prim_id: NDArray[np.uint32]
    depth: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Examination:
    """Two images judged by the oracle in every pixel whose verdict is not EQUAL, and in a sample of all pixels.

    agreement: of the two, all pixels. pixels: (N,) int64, those judged, y * width + x, ascending. disputed: (N,) bool,
    the verdict is not EQUAL. sampled: (N,) bool, part of the sample. truth: the nearest hits. hits_wrong,
    reference_wrong: (N,) bool, whose answer is a triangle that is neither the nearest nor one at the same depth to
    TIE_TOLERANCE of `atra.exact.ties`, a miss in front of a triangle, or a depth that `compare` does not accept.
    """

    agreement: Agreement
    pixels: NDArray[np.int64]
    disputed: NDArray[np.bool_]
    sampled: NDArray[np.bool_]
    truth: Truth
    hits_wrong: NDArray[np.bool_]
    reference_wrong: NDArray[np.bool_]


def nearest_hits(
    mesh: Mesh, camera: View, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
) -> Truth:
    """The nearest hit of the ray of each pixel (x, y), found by testing all triangles in float64.

    x, y: (N,) integers. Edges belong to the triangle, and of triangles at one depth the lowest `prim_id` wins,
    both to FLOAT64_TOLERANCE. Raises InputError for a bad offset.
    """
    mesh, camera = own_space(mesh, camera)
    corners = camera.to_camera_space(mesh.triangles(np.arange(mesh.triangle_count)).reshape(-1, 3)).reshape(-1, 3, 3)
    rays, prim_ids = near_pairs(*camera.rays(x, y, offset), corners)
    depths, is_met = _met(Pairs(mesh, camera, x[rays], y[rays], prim_ids, offset))
    depth, prim_id = nearest_of(len(x), rays, prim_ids, np.where(is_met, depths, np.inf))
    return Truth(prim_id, depth)


def sample_pixels(camera: View, rays: int, seed: Sequence[int]) -> NDArray[np.int64]:
    """(rays,) int64, distinct random pixels y * width + x, repeatable by `seed`; all pixels if there are fewer."""
    pixels = camera.width * camera.height
    return np.random.default_rng(seed).choice(pixels, min(rays, pixels), replace=False).astype(np.int64)


def examine(hits: Hits, reference: Hits, sample: Sequence[int] | NDArray[np.integer] = ()) -> Examination:
    """Decide which of two images is wrong wherever they disagree, and in a sample of all pixels.

    sample: pixels y * width + x that are examined in any case, since both images may be wrong. The truth is that of
    `nearest_hits`; beyond EXHAUSTIVE_TESTS, outside the sample, it is the nearest triangle that either image names and
    float64 confirms. Raises InputError as `compare`.
    """
    agreement, mesh, camera = compare(hits, reference), hits.mesh, hits.camera
    verdict = agreement.verdict.reshape(-1)
    sampled = np.zeros(verdict.size, bool)
    sampled[np.asarray(sample, np.int64)] = True
    pixels = np.flatnonzero(sampled | (verdict != Verdict.EQUAL))
    y, x = np.divmod(pixels, camera.width)
    exhaustive = sampled[pixels] | (len(pixels) * mesh.triangle_count <= EXHAUSTIVE_TESTS)
    named = [Pairs(mesh, camera, x, y, image.prim_id[y, x], image.offset) for image in (hits, reference)]
    truth = _truth(named[0], named[1].prim_id, exhaustive)
    wrong = []
    for image, pairs in zip((hits, reference), named, strict=True):
        wrong.append(_is_wrong(pairs, truth))
        if agreement.pixels_wrong:  # the verdict does not tell which image's depth is wrong
            wrong[-1] |= compare(image, image).verdict[y, x] == Verdict.WRONG
    return Examination(agreement, pixels, verdict[pixels] != Verdict.EQUAL, sampled[pixels], truth, *wrong)


def _truth(pairs: Pairs, other: NDArray[np.integer], exhaustive: NDArray[np.bool_]) -> Truth:
    """The nearest of all triangles where `exhaustive`, elsewhere of those of `pairs` and `other`."""
    rays = np.repeat(np.arange(len(other)), 2)
    prim_ids = np.sort(np.stack([pairs.prim_id, other], axis=1), axis=1).ravel()  # the lowest of ties wins
    depths, is_met = _met(replace(pairs[rays], prim_id=prim_ids))
    depth, prim_id = nearest_of(len(other), rays, prim_ids, np.where(is_met, depths, np.inf))
    x, y = pairs.x[exhaustive], pairs.y[exhaustive]
    tested = nearest_hits(pairs.mesh, pairs.camera, x, y, pairs.offset)
    depth[exhaustive], prim_id[exhaustive] = tested.depth, tested.prim_id
    return Truth(prim_id, depth)


def _is_wrong(pairs: Pairs, truth: Truth) -> NDArray[np.bool_]:
    """Whether the triangles of `pairs` are others than the nearest, and not as deep."""
    depth, is_met = _met(pairs)
    with np.errstate(invalid="ignore"):  # inf - inf
        as_deep = np.abs(depth - truth.depth) <= TIE_TOLERANCE * np.maximum(depth, truth.depth)
    return (pairs.prim_id != truth.prim_id) & ~(is_met & as_deep)


def _met(pairs: Pairs) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Depth at which every ray meets its own triangle's plane, (N,) float64, inf for a miss, and whether that is on the
    triangle, (N,) bool."""
    depth, is_met = np.full(len(pairs.prim_id), np.inf), np.zeros(len(pairs.prim_id), bool)
    named = pairs.prim_id != MISS
    met = pairs[named].intersections
    depth[named], is_met[named] = met.depth, met.edge_distance >= -FLOAT64_TOLERANCE
    return depth, is_met
