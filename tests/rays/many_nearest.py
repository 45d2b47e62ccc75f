"""`python -m tests.rays.many_nearest [SCALE] [FILE]`: nearest hits of ten million rays against exact arithmetic, of
`RayScene` with each precision, Open3D, and trimesh with embreex; prints a table.

The table that is kept is `reports/reference/nearest/many_nearest.csv`. SCALE: share of the rays, 1 by default.
Scenes of ATRA_SCENES are taken where they are. What is right is found in float64 with proved bounds
(`near_reference`), and in whole numbers where these leave it open (`near_whole_numbers`).

wrong: another triangle than the nearest, of equally near ones that of the lowest `prim_id`, at edges that of the tie
rule. Only "exact" promises such rules: of the others a triangle that the ray touches as near is right, and one that it
touches in an edge or corner alone is not false. lost: no hit, or not occluded. t off: of right triangles, by more than
a unit of float32.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from tests.rays import near_reference as reference
from tests.rays.near_libraries import LIBRARIES
from tests.rays.near_rays import KINDS, mesh_names, mesh_of, rays_of
from tests.rays.near_whole_numbers import ExactRay, shift_of

RAYS = 10_000_000
"""Rays in all, at scale 1."""

COLUMNS = (
    "library", "mesh", "triangles", "at", "kind", "rays", "hits", "wrong", "lost", "false", "t off", "in whole numbers",
)  # fmt: skip

_SMALL, _LARGE = 2.0**-200, 2.0**100


class Truth:
    """The nearest hits of some rays, (N, 3) origins and directions, at triangles, (F, 3, 3) float64.

    prim_ids: (N,) int64, -1: there is none. t, errors: (N,) float64, of the hits, and how far they are off at most.
    decided: how many rays whole numbers decided.
    """

    def __init__(self, tree, corners, origins, directions):
        self.corners, self.origins, self.directions = corners, origins, directions
        self._shifts = shift_of(corners, origins), shift_of(directions)
        count = len(origins)
        states, counts = np.empty(count, np.int8), np.empty(count, np.int64)
        rivals = np.empty((count, reference.MOST), np.int64)
        self.t, self.errors = np.full(count, np.inf), np.zeros(count)
        reference.nearest(corners, *tree, origins, directions, states, rivals, counts, self.t, self.errors)
        self.prim_ids = np.where(states == reference.SURE, rivals[:, 0], -1)
        left = np.flatnonzero(states > reference.SURE)
        self.decided = len(left)
        for ray in left:
            some = np.sort(rivals[ray, : counts[ray]])
            if states[ray] == reference.TOO_MANY:
                some = np.arange(len(corners))
            found = self.exact(ray).nearest(some.tolist())
            self.prim_ids[ray] = -1 if found is None else found[1]
            self.t[ray] = np.inf if found is None else float(found[0])
            self.errors[ray] = 0.0 if found is None else 2 * reference.U * self.t[ray]
        self.t[self.prim_ids < 0] = np.inf

    def exact(self, ray):
        return ExactRay(self.corners, self.origins[ray], self.directions[ray], self._shifts)

    def faults(self, prim_ids, t, occluded, is_strict):
        """(wrong, lost, false, t off) of what a library says of the rays."""
        expected = self.prim_ids
        other = np.flatnonzero((prim_ids >= 0) & (prim_ids != expected))
        is_right = prim_ids == expected
        if not is_strict:
            for ray in other[self._is_close(other, prim_ids)]:
                exact = self.exact(ray)
                found = exact.touches(int(prim_ids[ray]))
                crossed = expected[ray] >= 0
                nearest = exact.crosses(int(expected[ray])) if crossed else found
                is_right[ray] = found is not None and (found <= nearest)
        named, hit = prim_ids >= 0, expected >= 0
        wrong = int((hit & named & ~is_right).sum())
        lost = int((hit & (~named | ~occluded)).sum())
        false = int((~hit & ((named & ~is_right) | (occluded & ~named))).sum())
        return wrong, lost, false, self._off(np.flatnonzero(hit & is_right), t)

    def _is_close(self, rays, prim_ids):
        """Whether the triangles named may be as near as the nearest hits, so that whole numbers have to tell."""
        a, b, c = np.moveaxis(self.corners[prim_ids[rays]], 1, 0)
        normal = np.cross(b - a, c - a)
        with np.errstate(all="ignore"):
            ahead = np.einsum("ij,ij->i", normal, a - self.origins[rays])
            t = ahead / np.einsum("ij,ij->i", normal, self.directions[rays])
            return ~(np.abs(t - self.t[rays]) > 1e-4 * np.abs(self.t[rays])) | (self.prim_ids[rays] < 0)

    def _off(self, rays, t):
        """How many of the rays' t differ from the exact ones by more than a unit of float32."""
        given, nearest, errors = t[rays].astype(np.float64), self.t[rays], self.errors[rays]
        with np.errstate(over="ignore"):
            unit = np.spacing(np.maximum(np.abs(given), nearest).astype(np.float32)).astype(np.float64)
        off, slack = np.abs(given - nearest), errors + 4 * reference.U * nearest
        count = int((off > unit + slack).sum())
        for place in np.flatnonzero((off > unit - slack) & ~(off > unit + slack)):
            ray = rays[place]
            exact = self.exact(ray).crosses(int(self.prim_ids[ray]))
            count += abs(exact - type(exact)(given[place])) > type(exact)(unit[place])
        return count


def _check(*arrays):
    for array in arrays:
        sizes = np.abs(array[array != 0])
        if sizes.size and not (sizes.min() > _SMALL and sizes.max() < _LARGE):
            raise ValueError(f"numbers from {sizes.min()} to {sizes.max()}: the proof holds from {_SMALL} to {_LARGE}")


def tree_over(corners):
    """The arguments of `near_reference.nearest` that hold a tree over (F, 3, 3) float64 corners."""
    size = len(corners)
    boxes, kinds = np.empty((2, 2 * size, 3)), np.empty((2, 2 * size), np.int64)
    tree = np.arange(size), boxes[0], boxes[1], kinds[0], kinds[1]
    reference.build(corners, *tree)
    return tree


def rows_of(name, is_far, count):
    """The table's rows of a mesh, `count` rays of each kind."""
    mesh, vertices = mesh_of(name, is_far)
    corners = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64)
    if not np.array_equal(corners, vertices[mesh.faces].astype(np.float64)):
        raise ValueError(f"{name}: the mesh does not hold the vertices given")
    tree = tree_over(corners)
    answers = {library: make(mesh, vertices) for library, make in LIBRARIES.items()}
    random, rows = np.random.default_rng(1), []
    for kind in KINDS:
        rays = rays_of(kind, corners, count, np.float64 if is_far else np.float32, random)
        _check(corners, *rays)
        truth = Truth(tree, corners, *(array.astype(np.float64) for array in rays))
        start = name, len(corners), "UTM" if is_far else "origin", kind, count, int((truth.prim_ids >= 0).sum())
        for library, answer in answers.items():
            faults = truth.faults(*answer(*rays), is_strict=library == "exact")
            rows.append((library, *start, *faults, truth.decided))
    return rows


def main(scale=1.0, path=None):
    names = mesh_names()
    count = max(int(float(scale) * RAYS / len(names) / len(KINDS)), 1)
    print(",".join(COLUMNS))
    rows = []
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for found in pool.map(rows_of, *zip(*names, strict=True), [count] * len(names)):
            rows += found
            for row in found:
                print(*row, sep=",", flush=True)
    for library in LIBRARIES:
        total = np.array([row[6:11] for row in rows if row[0] == library]).sum(axis=0)
        rays = sum(row[5] for row in rows if row[0] == library)
        print(f"{library}: of {rays:,} rays {total[0]:,} hit; wrong, lost, false, t off:", *total[1:])
    if path:
        with open(path, "w", encoding="utf-8") as file:
            file.writelines(",".join(map(str, row)) + "\n" for row in (COLUMNS, *rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
