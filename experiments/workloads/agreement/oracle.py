"""The oracle: the nearest hit of a ray in float64, and which of two images that disagree is wrong.

`compare` decides whether float32 excuses a difference. The oracle excuses nothing: it finds the nearest triangle by
testing all, and an image names it, one at the same depth, or neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.errors import InputError
from atra.exact.intersection import FLOAT64_TOLERANCE, Pairs, triangles_in_camera_space
from atra.exact.rounding import Rounding
from atra.exact.ties import TIE_TOLERANCE
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import Agreement, Verdict, compare
from atra.judge.holes import is_closed_around
from atra.prim_ids import MISS
from experiments.workloads.agreement.brute_force_kernels import nearest_triangles

EXHAUSTIVE_TESTS = 2e10
"""Rays times triangles up to which `examine` tests all triangles. Images that disagree in more pixels are broken, and
the nearer one of their two answers then counts as the truth."""


class Correctness(IntEnum):
    """How right an image is in one pixel."""

    RIGHT = 0
    """The nearest triangle, or correctly a miss."""
    TIED = 1
    """Another triangle that the ray hits at the same depth, to TIE_TOLERANCE of `atra.exact.ties`."""
    WRONG_TRIANGLE = 2
    """A triangle that the ray misses or hits farther away, or a miss in front of a triangle."""
    WRONG_DEPTH = 3
    """The nearest triangle, or one at the same depth, with a depth that `compare` does not accept."""
    HOLE = 4
    """A miss, or a triangle behind, where the ray hits a surface inside, not at its rim (`atra.judge.holes`)."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The nearest hit of N rays.

    prim_id: (N,) uint32, the lowest one of triangles at the same depth; MISS = miss.
    depth: (N,) float64, scene units; inf = miss.
    edge_distance: (N,) float64, barycentric distance to the triangle's nearest edge; NaN = miss.
    exhaustive: (N,) bool, whether all triangles were tested, not only those that the images name.
    """

    prim_id: NDArray[np.uint32]
    depth: NDArray[np.float64]
    edge_distance: NDArray[np.float64]
    exhaustive: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Answer:
    """An image's answers for N pixels, judged.

    prim_id: (N,) uint32, the triangle that it names. stored_depth: (N,) float32, the depth that it stores.
    depth, edge_distance: (N,) float64, of the ray's hit on that triangle's plane, as in `Intersections`; inf and NaN
    for a miss.
    correctness: (N,) uint8, values of `Correctness`.
    off_by: (N,) float64, barycentric error of a wrong triangle: the distance by which the ray misses it, otherwise how
    far inside the nearest triangle the ray hits that. inf for a named triangle without area or edge-on; 0 if right.
    """

    prim_id: NDArray[np.uint32]
    stored_depth: NDArray[np.float32]
    depth: NDArray[np.float64]
    edge_distance: NDArray[np.float64]
    correctness: NDArray[np.uint8]
    off_by: NDArray[np.float64]

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """(N,) bool, whether the triangle or its depth is wrong."""
        return self.correctness >= Correctness.WRONG_TRIANGLE

    @property
    def holes(self) -> NDArray[np.bool_]:
        """(N,) bool, whether the answer is a hole."""
        return self.correctness == Correctness.HOLE


@dataclass(frozen=True, eq=False)
class Examination:
    """Two images judged by the oracle in every pixel whose verdict is not EQUAL, and in a sample of all pixels.

    x, y: (N,) int64, the pixels, row by row. verdict: (N,) uint8, of `compare`. sampled: (N,) bool, part of the sample.
    truth: the nearest hits. hits, reference: the answers of the two images.
    """

    x: NDArray[np.int64]
    y: NDArray[np.int64]
    verdict: NDArray[np.uint8]
    sampled: NDArray[np.bool_]
    truth: Truth
    hits: Answer
    reference: Answer

    @property
    def disputed(self) -> NDArray[np.bool_]:
        """(N,) bool, whether the verdict is not EQUAL."""
        return self.verdict != Verdict.EQUAL


def nearest_hits(
    mesh: Mesh,
    camera: View,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    offset: tuple[float, float] = (0.5, 0.5),
    threads: int | None = 1,
) -> Truth:
    """The nearest hit of the ray of each pixel (x, y), found by testing all triangles in float64.

    x, y: (N,) integers. Edges belong to the triangle, and of triangles at one depth the lowest `prim_id` wins,
    both to FLOAT64_TOLERANCE. Raises InputError for a bad offset or thread count.
    """
    mesh, camera = own_space(mesh, camera)
    origins, directions = (np.ascontiguousarray(part.T) for part in camera.rays(x, y, offset))
    geometry = triangles_in_camera_space(mesh, camera, np.arange(mesh.triangle_count))
    depth, prim_id = np.empty(len(x)), np.empty(len(x), np.uint32)
    pool, eye_square = WorkerPool(resolve_threads(threads)), float(np.dot(camera.eye, camera.eye))
    rest = origins, directions, *geometry, eye_square, depth, prim_id
    try:
        pool.run(lambda _, counter: nearest_triangles(counter, *rest))
    finally:
        pool.close()
    edge_distance = _met(Pairs(mesh, camera, x, y, prim_id, offset))[1]
    return Truth(prim_id, depth, edge_distance, np.ones(len(x), bool))


def sample_pixels(camera: View, rays: int, seed: Sequence[int]) -> NDArray[np.int64]:
    """(rays,) int64, distinct random pixels y * width + x, repeatable by `seed`; all pixels if there are fewer."""
    pixels = camera.width * camera.height
    return np.random.default_rng(seed).choice(pixels, min(rays, pixels), replace=False).astype(np.int64)


def examine(
    mesh: Mesh,
    camera: View,
    hits: Hits,
    reference: Hits,
    agreement: Agreement,
    sample: NDArray[np.integer] | None = None,
    threads: int | None = 1,
) -> Examination:
    """Decide which of two images is wrong wherever they disagree, and in a sample of all pixels.

    agreement: from `compare`. sample: pixels y * width + x that are examined in any case, since both images may be
    wrong. The truth is that of `nearest_hits`; beyond EXHAUSTIVE_TESTS, outside the sample, it is the nearest triangle
    that either image names and float64 confirms.
    Raises InputError as `compare`, and for an `agreement` of another size.
    """
    shape = (camera.height, camera.width)
    if agreement.verdict.shape != shape:
        raise InputError(f"agreement is of an image of {agreement.verdict.shape}, the camera's is {shape}")
    sampled = np.zeros(agreement.verdict.size, bool)
    if sample is not None:
        sampled[sample] = True
    verdict = agreement.verdict.reshape(-1)
    pixels = np.flatnonzero(sampled | (verdict != Verdict.EQUAL))
    y, x = np.divmod(pixels, camera.width)
    exhaustive = sampled[pixels] | (len(pixels) * mesh.triangle_count <= EXHAUSTIVE_TESTS)
    named = [Pairs(mesh, camera, x, y, image.prim_id[y, x], image.offset) for image in (hits, reference)]
    truth = _truth(named[0], named[1].prim_id, exhaustive, threads)
    answers = []
    for image, pairs in zip((hits, reference), named, strict=True):
        depth_is_wrong = np.zeros(len(pixels), bool)
        if agreement.pixels_wrong:  # the verdict does not tell which image's depth is wrong
            depth_is_wrong = compare(image, image).verdict[y, x] == Verdict.WRONG
        answers.append(_judge_answer(pairs, image.depth[y, x], truth, depth_is_wrong))
    return Examination(x, y, verdict[pixels], sampled[pixels], truth, answers[0], answers[1])


def _truth(pairs: Pairs, other: NDArray[np.integer], exhaustive: NDArray[np.bool_], threads: int | None) -> Truth:
    """The nearest of all triangles where `exhaustive`, elsewhere of those of `pairs` and `other`."""
    depth, prim_id = np.full(len(other), np.inf), np.full(len(other), MISS)
    for candidate in (np.minimum(pairs.prim_id, other), np.maximum(pairs.prim_id, other)):  # the lowest of ties wins
        met, edge_distance = _met(replace(pairs, prim_id=candidate))
        nearer = (edge_distance >= -FLOAT64_TOLERANCE) & (met > 0.0) & (met < depth * (1.0 - FLOAT64_TOLERANCE))
        depth[nearer], prim_id[nearer] = met[nearer], candidate[nearer]
    x, y = pairs.x[exhaustive], pairs.y[exhaustive]
    tested = nearest_hits(pairs.mesh, pairs.camera, x, y, pairs.offset, threads)
    depth[exhaustive], prim_id[exhaustive] = tested.depth, tested.prim_id
    return Truth(prim_id, depth, _met(replace(pairs, prim_id=prim_id))[1], exhaustive)


def _judge_answer(
    pairs: Pairs, stored_depth: NDArray[np.float32], truth: Truth, depth_is_wrong: NDArray[np.bool_]
) -> Answer:
    depth, edge_distance = _met(pairs)
    is_met = edge_distance >= -FLOAT64_TOLERANCE  # False for a miss
    with np.errstate(invalid="ignore"):  # inf - inf
        as_deep = np.abs(depth - truth.depth) <= TIE_TOLERANCE * np.maximum(depth, truth.depth)
    right = pairs.prim_id == truth.prim_id
    tied = ~right & is_met & as_deep
    correctness = np.select(
        [depth_is_wrong & (right | tied), right, tied],
        [np.uint8(Correctness.WRONG_DEPTH), np.uint8(Correctness.RIGHT), np.uint8(Correctness.TIED)],
        np.uint8(Correctness.WRONG_TRIANGLE),
    )
    correctness[_holes(pairs, correctness, depth, truth)] = Correctness.HOLE
    beside = (pairs.prim_id != MISS) & ~is_met
    # Within FLOAT64_TOLERANCE a ray hits from slightly outside; its distance counts as 0.
    off_by = np.where(right | tied, 0.0, np.where(beside, -edge_distance, np.maximum(truth.edge_distance, 0.0)))
    prim_id = np.asarray(pairs.prim_id, np.uint32)
    return Answer(prim_id, stored_depth, depth, edge_distance, correctness, off_by)


def _holes(pairs: Pairs, correctness: NDArray[np.uint8], depth: NDArray[np.float64], truth: Truth) -> NDArray[np.int64]:
    """Indices of the answers with a wrong triangle that are holes; pairs, depth: of the answers."""
    asked = np.flatnonzero((correctness == Correctness.WRONG_TRIANGLE) & (truth.prim_id != MISS))
    nearest, pairs = replace(pairs, prim_id=truth.prim_id), pairs[asked]
    error = Rounding.of(nearest[asked]).depth * truth.depth[asked]
    limit, named = depth[asked].copy(), pairs.prim_id != MISS
    own_error = Rounding.of(pairs[named]).depth
    is_known = own_error < np.inf
    least = np.full(len(own_error), -np.inf)  # lower limit of depths that may have any value
    least[is_known] = limit[named][is_known] * (1.0 - own_error[is_known])
    limit[named] = least
    behind = np.isfinite(error) & (truth.depth[asked] + error < limit)
    asked, limit = asked[behind], limit[behind]
    return asked[is_closed_around(nearest[asked], limit)]


def _met(pairs: Pairs) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth and edge distance, (N,) float64 each, of every ray's own triangle; inf and NaN for a miss."""
    depth, edge_distance = np.full(len(pairs.prim_id), np.inf), np.full(len(pairs.prim_id), np.nan)
    named = pairs.prim_id != MISS
    met = pairs[named].intersections
    depth[named], edge_distance[named] = met.depth, met.edge_distance
    return depth, edge_distance
