"""Cells of the mesh's box without triangles, each inside or outside: points in them need no ray."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.rays.all_hits.cells_kernels import OUTSIDE, UNKNOWN, look_up, mark_cells
from atra.rays.tree.finding import HitFinder

FEWEST_POINTS = 1 << 16
"""Points, of all calls together, from which on cells are worth making."""

_PER_TRIANGLE, _FEWEST, _MOST = 16, 1 << 12, 1 << 22
"""Cells for each triangle, and limits of their number."""


@dataclass(frozen=True, eq=False)
class Cells:
    """known: (X, Y, Z) uint8, `OUTSIDE`, `INSIDE` or `UNKNOWN`. bounds: (2, 3) float64. inverse: (3,) float64."""

    known: NDArray[np.uint8]
    bounds: NDArray[np.float64]
    inverse: NDArray[np.float64]

    def parity(self, points: NDArray[np.float64], finder: HitFinder, pool: WorkerPool) -> NDArray[np.bool_]:
        """(P,) bool: whether a ray from each point, (P, 3) float64, crosses an odd number of triangles."""
        found = np.empty(len(points), np.uint8)
        given = points, *self.bounds, self.inverse, self.known
        pool.run(lambda _, counter: look_up(counter, *given, found))
        left = np.flatnonzero(found == UNKNOWN)
        found[left] = finder.columns(points[left]).counts & 1
        return found.view(np.bool_)


def cells_of(finder: HitFinder, kept: NDArray[np.bool_] | None) -> Cells:
    """The cells of a closed mesh, about `_PER_TRIANGLE` for each triangle. kept: (F,) bool, its triangles.

    Cells of a row that no triangle parts are equal, so one ray decides for all of them.
    """
    mesh = finder.mesh
    low, high = mesh.bounds
    sizes = np.maximum(high - low, 1e-3 * (high - low).max() or 1.0)
    wanted = min(max(_PER_TRIANGLE * mesh.triangle_count, _FEWEST), _MOST)
    counts = np.maximum(sizes * np.cbrt(wanted / sizes.prod()), 1.0).astype(np.int64)
    inverse = counts / sizes
    known = np.full(counts, OUTSIDE, np.uint8)
    kept = np.ones(mesh.triangle_count, np.bool_) if kept is None else kept
    mark_cells(mesh.vertices, mesh.faces, kept, low, inverse, known)
    is_empty = known != UNKNOWN
    starts = is_empty.copy()
    starts[:, :, 1:] &= ~is_empty[:, :, :-1]
    middles = np.ascontiguousarray(low + (np.argwhere(starts) + 0.5) / inverse)
    odd = (finder.columns(middles).counts & 1).astype(np.uint8)
    run = np.cumsum(starts.reshape(-1)) - 1
    empty = is_empty.reshape(-1)
    known.reshape(-1)[empty] = odd[run[empty]]
    return Cells(known, mesh.bounds, inverse)
