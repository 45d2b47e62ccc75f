"""The oracle: what a ray hits first in float64, and which of two images that disagree is wrong about it.

`compare` says whether float32 excuses a difference. The oracle excuses nothing: there is one nearest triangle, found by
testing all of them, and an image named it, one just as deep, or neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.errors import InputError
from atra.exact.brute_force_kernels import SLACK, nearest_triangles
from atra.exact.intersection import Pairs, intersect_pixels, triangles_in_camera_space
from atra.exact.rounding import Rounding
from atra.exact.ties import TIE_TOLERANCE
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import Agreement, Verdict, compare
from atra.judge.holes import is_closed_around
from atra.prim_ids import MISS

EXHAUSTIVE_TESTS = 2e10
"""Rays times triangles up to which `examine` tests all, a minute's work. Images that disagree at more pixels are
broken, not rounded differently, and there the nearer of their two answers passes for the truth."""


class Correctness(IntEnum):
    """How an image's answer for one pixel stands before the oracle."""

    RIGHT = 0
    """The nearest triangle, or rightly nothing."""
    TIED = 1
    """Another triangle that the ray hits just as deep, to TIE_TOLERANCE of `atra.exact.ties`."""
    WRONG_TRIANGLE = 2
    """A triangle the ray misses or hits farther away, or nothing where there is something."""
    WRONG_DEPTH = 3
    """The nearest triangle or one as deep, with a depth that `compare` does not accept."""
    HOLE = 4
    """Nothing, or something behind, where the ray hits a triangle, and not by the rounding of float32 at an open rim:
    inside of it, or between it and a neighbour (`atra.judge.holes`)."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The nearest hit of N rays.

    prim_id: (N,) uint32, of equally deep triangles the lowest; MISS = nothing is hit.
    depth: (N,) float64, scene units; inf = miss.
    edge_distance: (N,) float64, barycentric distance to the triangle's nearest edge; NaN = miss.
    exhaustive: (N,) bool, all triangles were tested, not only those that two images name.
    """

    prim_id: NDArray[np.uint32]
    depth: NDArray[np.float64]
    edge_distance: NDArray[np.float64]
    exhaustive: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Answer:
    """What an image says of N pixels, and how that stands.

    prim_id: (N,) uint32, the triangle it names. stored_depth: (N,) float32, the depth it stores.
    depth, edge_distance: (N,) float64, where the ray meets that triangle's plane in float64, as in
    `atra.exact.intersection.Intersections`; inf and NaN where it names none.
    correctness: (N,) uint8, values of `Correctness`.
    off_by: (N,) float64, barycentric: how far a wrong answer is from a right one. A triangle that is missed is missed
    by this, otherwise the nearest triangle was overlooked this far inside its edges. inf where a triangle without
    area, or edge-on, was named; 0 where the triangle is right.
    """

    prim_id: NDArray[np.uint32]
    stored_depth: NDArray[np.float32]
    depth: NDArray[np.float64]
    edge_distance: NDArray[np.float64]
    correctness: NDArray[np.uint8]
    off_by: NDArray[np.float64]

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """(N,) bool, the triangle or its depth is wrong."""
        return self.correctness >= Correctness.WRONG_TRIANGLE

    @property
    def holes(self) -> NDArray[np.bool_]:
        """(N,) bool, those of the wrong ones that are holes."""
        return self.correctness == Correctness.HOLE


@dataclass(frozen=True, eq=False)
class Examination:
    """Two images before the oracle: at every pixel whose verdict is not EQUAL, and at a sample of all pixels.

    x, y: (N,) int64, the pixels, row by row, each once. verdict: (N,) uint8, of `compare`.
    sampled: (N,) bool, part of the sample.
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
        """(N,) bool, the verdict is not EQUAL."""
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

    x, y: (N,) integers. The rules are those of `atra.judge.reference.brute_force`, whose hits these are: edges belong
    to the triangle, the lowest of equally deep triangles wins, both with a slack of 1e-12, and a hit has depth > 0.
    Takes N times F tests of some nanoseconds each. Raises InputError for a bad offset or thread count.
    """
    origins, directions = (np.ascontiguousarray(part.T) for part in camera.rays(x, y, offset))
    geometry = triangles_in_camera_space(mesh, camera, np.arange(mesh.triangle_count))
    depth, prim_id = np.empty(len(x)), np.empty(len(x), np.uint32)
    pool = WorkerPool(resolve_threads(threads))
    try:
        pool.run(lambda _, counter: nearest_triangles(counter, origins, directions, *geometry, depth, prim_id))
    finally:
        pool.close()
    edge_distance = _met(mesh, camera, x, y, prim_id, offset)[1]
    return Truth(prim_id, depth, edge_distance, np.ones(len(x), bool))


def sample_pixels(camera: View, rays: int, seed: Sequence[int]) -> NDArray[np.int64]:
    """(rays,) int64, distinct pixels y * width + x, drawn evenly and repeatably; all pixels if there are fewer."""
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
    """Decide for every pixel where two images disagree which of them is wrong, and look at a sample of the others.

    agreement: what `compare` says of the two. sample: pixels y * width + x that are looked at in any case, since two
    images may be wrong alike. The truth is that of `nearest_hits`; beyond EXHAUSTIVE_TESTS, outside the sample, it is
    the nearest that either image names and float64 confirms.
    Raises InputError where `compare` does, and if `agreement` is of another size.
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
    truth = _truth(mesh, camera, x, y, hits, reference, exhaustive, threads)
    answers = []
    for image in (hits, reference):
        # A wrong depth makes the verdict WRONG, whose depth it is is seen when the image is compared with itself.
        depth_is_wrong = np.zeros(len(pixels), bool)
        if agreement.pixels_wrong:
            depth_is_wrong = compare(mesh, camera, image, image).verdict[y, x] == Verdict.WRONG
        answers.append(_judge_answer(mesh, camera, image, x, y, truth, depth_is_wrong))
    return Examination(x, y, verdict[pixels], sampled[pixels], truth, answers[0], answers[1])


def _truth(
    mesh: Mesh,
    camera: View,
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    hits: Hits,
    reference: Hits,
    exhaustive: NDArray[np.bool_],
    threads: int | None,
) -> Truth:
    """The nearest of all triangles where `exhaustive`, elsewhere of the two that are named."""
    depth, prim_id = np.full(len(x), np.inf), np.full(len(x), MISS)
    named = hits.prim_id[y, x], reference.prim_id[y, x]
    for candidate in (np.minimum(*named), np.maximum(*named)):  # of equally deep ones the lowest wins
        met, edge_distance = _met(mesh, camera, x, y, candidate, hits.offset)
        nearer = (edge_distance >= -SLACK) & (met > 0.0) & (met < depth * (1.0 - SLACK))
        depth[nearer], prim_id[nearer] = met[nearer], candidate[nearer]
    tested = nearest_hits(mesh, camera, x[exhaustive], y[exhaustive], hits.offset, threads)
    depth[exhaustive], prim_id[exhaustive] = tested.depth, tested.prim_id
    return Truth(prim_id, depth, _met(mesh, camera, x, y, prim_id, hits.offset)[1], exhaustive)


def _judge_answer(
    mesh: Mesh,
    camera: View,
    image: Hits,
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    truth: Truth,
    depth_is_wrong: NDArray[np.bool_],
) -> Answer:
    prim_id = image.prim_id[y, x]
    depth, edge_distance = _met(mesh, camera, x, y, prim_id, image.offset)
    is_met = edge_distance >= -SLACK  # False for nothing
    with np.errstate(invalid="ignore"):  # inf - inf
        as_deep = np.abs(depth - truth.depth) <= TIE_TOLERANCE * np.maximum(depth, truth.depth)
    right = prim_id == truth.prim_id
    tied = ~right & is_met & as_deep
    correctness = np.select(
        [depth_is_wrong & (right | tied), right, tied],
        [np.uint8(Correctness.WRONG_DEPTH), np.uint8(Correctness.RIGHT), np.uint8(Correctness.TIED)],
        np.uint8(Correctness.WRONG_TRIANGLE),
    )
    pairs = Pairs(mesh, camera, x, y, truth.prim_id, image.offset)
    correctness[_holes(pairs, correctness, prim_id, depth, truth)] = Correctness.HOLE
    beside = (prim_id != MISS) & ~is_met
    # The slack may make a hit of a ray that passes a trace outside.
    off_by = np.where(right | tied, 0.0, np.where(beside, -edge_distance, np.maximum(truth.edge_distance, 0.0)))
    return Answer(prim_id, image.depth[y, x], depth, edge_distance, correctness, off_by)


def _holes(
    pairs: Pairs,
    correctness: NDArray[np.uint8],
    prim_id: NDArray[np.uint32],
    depth: NDArray[np.float64],
    truth: Truth,
) -> NDArray[np.int64]:
    """Which answers with a wrong triangle are holes; pairs: rays and the nearest triangles. depth: of the answers."""
    asked = np.flatnonzero((correctness == Correctness.WRONG_TRIANGLE) & (truth.prim_id != MISS))
    error = Rounding.of(pairs[asked]).depth * truth.depth[asked]
    limit, named = depth[asked].copy(), prim_id[asked] != MISS
    own = replace(pairs[asked], prim_id=prim_id[asked])[named]
    own_error = Rounding.of(own).depth
    is_known = own_error < np.inf
    least = np.full(len(own_error), -np.inf)  # of a depth that may be any
    least[is_known] = limit[named][is_known] * (1.0 - own_error[is_known])
    limit[named] = least
    behind = np.isfinite(error) & (truth.depth[asked] + error < limit)
    asked, limit = asked[behind], limit[behind]
    return asked[is_closed_around(pairs[asked], limit)]


def _met(
    mesh: Mesh,
    camera: View,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    prim_id: NDArray[np.uint32],
    offset: tuple[float, float],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth and edge distance, (N,) float64 each, of every ray's own triangle; inf and NaN where it is none."""
    depth, edge_distance = np.full(len(prim_id), np.inf), np.full(len(prim_id), np.nan)
    named = prim_id != MISS
    found = intersect_pixels(mesh, camera, x[named], y[named], prim_id[named], offset)
    depth[named], edge_distance[named] = found.depth, found.edge_distance
    return depth, edge_distance
