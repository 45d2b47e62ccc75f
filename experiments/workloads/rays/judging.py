"""What is right: some rays tested with every triangle, decided without rounding, and what answers lose against that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import intersect_rays
from atra.exact.lines_kernels import PARTS
from atra.geometry.mesh import Mesh
from atra.prim_ids import MISS
from experiments.methods.peers.peer import Asked
from experiments.workloads.brute_force import near_pairs, nearest_of
from experiments.workloads.rays.judging_kernels import decide_crossings

_AS_NEAR = 1e-5
"""Relative difference of two distances within which float32 may take either triangle for the nearer."""

_WAY = np.array([0.4395, 0.6176, 0.6523], np.float32)
"""Direction of the ray whose crossings decide whether a point lies inside."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Crossings of N rays. ray_ids, prim_ids: (M,) int64, counted from the first judged ray. nearest: (N,) float64,
    parameter of the nearest crossing, inf = none. counts: (N,) int64, what may be lost of each ray."""

    ray_ids: NDArray[np.int64]
    prim_ids: NDArray[np.int64]
    nearest: NDArray[np.float64]
    counts: NDArray[np.int64]

    @property
    def hits(self) -> int:
        """What may be lost."""
        return int(self.counts.sum())


def sample_of(count: int, judged: int) -> NDArray[np.int64]:
    """At most `judged` of `count` numbers, ascending and random."""
    return np.sort(np.random.default_rng(2).permutation(count)[:judged])


def truth_of(
    question: str, mesh: Mesh, origins: NDArray[np.float32], directions: NDArray[np.float32] | None = None
) -> Truth:
    """All crossings of rays, (N, 3) each, or of a ray from each point."""
    if directions is None:
        directions = np.broadcast_to(_WAY, origins.shape)
    corners = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64)
    rays = origins.astype(np.float64), directions.astype(np.float64)
    ray_ids, prim_ids = near_pairs(*rays, corners)
    crosses = np.empty(len(ray_ids), np.bool_)
    decide_crossings(corners, *rays, ray_ids, prim_ids, np.empty(PARTS), crosses)
    ray_ids, prim_ids = ray_ids[crosses], prim_ids[crosses]
    depths = intersect_rays(mesh, origins[ray_ids], directions[ray_ids], prim_ids).depth
    nearest, _ = nearest_of(len(origins), ray_ids, prim_ids, depths)
    counts = np.bincount(ray_ids, minlength=len(origins))
    if question == "contains":
        counts = counts % 2
    elif question in ("closest", "any"):
        counts = np.minimum(counts, 1)
    return Truth(ray_ids, prim_ids, nearest, counts)


def judged(
    question: str,
    answer: Asked,
    sample: NDArray[np.int64],
    truth: Truth,
    mesh: Mesh,
    rays: tuple[NDArray[np.float32], ...],
) -> tuple[int, int]:
    """(lost, extra) among the judged rays: hits that an answer lacks, and those that it has twice or in vain.

    sample: numbers of the judged rays in the batch, ascending. rays: origins and directions of these, or points.
    A closest hit is lost where nothing or something farther is hit, and extra where something is hit that lies nearer.
    """
    if question == "all":
        if not isinstance(answer, tuple):
            raise TypeError(f"the answer is {answer!r:.100}, expected the rays and the triangles of all hits")
        return _lost_pairs(answer, sample, truth, mesh.triangle_count)
    some = np.asarray(answer)[sample]
    if question == "closest":
        distances = _distances(some.astype(np.int64).astype(np.uint32), mesh, *rays)
        slack = _AS_NEAR * np.where(np.isfinite(truth.nearest), np.abs(truth.nearest), 0.0)
        return int((distances > truth.nearest + slack).sum()), int((distances < truth.nearest - slack).sum())
    missing = truth.counts - some.astype(np.int64)
    return int(missing.clip(min=0).sum()), int((-missing).clip(min=0).sum())


def _distances(
    prim_ids: NDArray[np.uint32], mesh: Mesh, origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> NDArray[np.float64]:
    """(N,) float64 parameters at which rays meet the planes of triangles, inf for `MISS`."""
    t = np.full(len(prim_ids), np.inf)
    named = prim_ids != MISS
    t[named] = intersect_rays(mesh, origins[named], directions[named], prim_ids[named]).depth
    return t


def _lost_pairs(
    answer: tuple[NDArray, NDArray], sample: NDArray[np.int64], truth: Truth, triangles: int
) -> tuple[int, int]:
    ray_ids, prim_ids = (np.asarray(array).astype(np.int64) for array in answer)
    place = np.searchsorted(sample, ray_ids)
    is_judged = np.append(sample, -1)[place] == ray_ids
    told = place[is_judged] * triangles + prim_ids[is_judged]
    true = truth.ray_ids * triangles + truth.prim_ids
    right = np.intersect1d(told, true)
    return len(true) - len(right), len(told) - len(right)
