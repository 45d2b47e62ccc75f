"""Whether points lie inside a mesh: by parity where it is closed, else by the generalised winding number."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.all_hits.closed import edge_surplus
from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.rays.all_hits.cells import FEWEST_POINTS, Cells, cells_of
from atra.rays.rays import SMALLEST, vectors
from atra.rays.rays_kernels import first_unfit
from atra.rays.tree.finding import HitFinder

METHODS = ("parity", "winding")

FARTHEST_POINT = 1e19
"""Largest size of points whose way to a mesh is computed."""

_EDGES = 1 << 18
"""Pairs of a point and an open edge whose solid angles are computed at a time."""


def check_points(points: ArrayLike, farthest: float = np.inf) -> NDArray[np.float64]:
    """(P, 3) float64, numbers below `SMALLEST` being 0. Raises InputError for another shape or dtype, and naming the
    first that is not finite or beyond `farthest` in size."""
    found = np.array(vectors("points", points), np.float64, order="C")
    first = first_unfit(found, 0.0, min(farthest, np.finfo(np.float64).max), SMALLEST)
    if first < len(found):
        most = f" of at most {farthest:g} in size" if farthest < np.inf else ""
        raise InputError(f"point {first} is {tuple(found[first].tolist())}, expected finite numbers{most}")
    return found


class Interior:
    """What decides whether points lie inside a mesh; points count from the mesh's own origin, (P, 3) float64 each.

    finder: of the mesh. faces: (F,) bool, triangles that rays meet; None: all. pool: threads.
    """

    def __init__(self, finder: HitFinder, faces: NDArray[np.bool_] | None, pool: WorkerPool) -> None:
        self.finder, self._faces, self._pool = finder, faces, pool
        self.cells: Cells | None = None
        self._asked = 0

    def contains(self, points: NDArray[np.float64], method: str) -> NDArray[np.bool_]:
        """(P,) bool, as `RayScene.contains` says."""
        if method == "winding":
            return self.winding_numbers(points) > 0.5
        if self.open_edges:
            raise InputError(
                f"{self.finder.mesh.name!r} is not closed: it has {self.open_edges:,} open edges, so parity says "
                'nothing; close its holes, or pass method="winding"'
            )
        return self.parity(points)

    @property
    def open_edges(self) -> int:
        """The number of edges with an odd number of triangles."""
        return self.edges[2]

    @cached_property
    def edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Edges of the triangles that rays meet and their surplus, as `edge_surplus` returns them."""
        mesh = self.finder.mesh
        return edge_surplus(mesh, mesh.faces if self._faces is None else mesh.faces[self._faces])

    def parity(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(P,) bool: whether a ray from each point crosses an odd number of triangles, of closed and open meshes."""
        self._asked += len(points)
        if self.cells is None and self._asked >= FEWEST_POINTS and not self.open_edges:
            self.cells = cells_of(self.finder, self._faces)
        if self.cells is not None:
            return self.cells.parity(points, self.finder, self._pool)
        return (self.finder.columns(points).counts & 1).astype(np.bool_)

    def winding_numbers(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(P,) float64, the generalised winding number of the mesh around each point.

        Curtains from the open edges to infinity close the mesh. Those that head against the ray of a point do not cross
        it. So the winding number is the sum of the signs of the ray's crossings, less the curtains' solid angles.
        Source: A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding
        numbers", 2013; C. Martens, M. Bessmeltsev, "One-shot method for computing generalized winding numbers", 2025.
        """
        edges, surplus, _ = self.edges
        ends = self.finder.mesh.vertices[edges].astype(np.float64)
        ways = self.finder.columns(points, everywhere=True)
        found = ways.turns.astype(np.float64)
        step = max(1, _EDGES // max(1, len(ends)))
        for start in range(0, len(points) if len(ends) else 0, step):
            some = slice(start, start + step)
            a = ends[None, :, 0] - points[some, None]
            b = ends[None, :, 1] - points[some, None]
            d = -ways.directions[some, None]
            sizes = np.linalg.norm(a, axis=2), np.linalg.norm(b, axis=2)
            volume = (np.cross(a, b) * d).sum(axis=2)
            rest = sizes[0] * sizes[1] + (a * b).sum(axis=2)
            rest = rest + (a * d).sum(axis=2) * sizes[1] + (b * d).sum(axis=2) * sizes[0]
            found[some] += (2.0 * np.arctan2(volume, rest) * surplus).sum(axis=1) / (4.0 * np.pi)
        return found
