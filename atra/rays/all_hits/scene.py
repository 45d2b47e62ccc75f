"""The part of a ray scene that finds all hits, which needs no Embree."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.all_hits.reductions import Reduction
from atra.compiled.threads import WorkerPool
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range
from atra.rays.all_hits.cells import FEWEST_POINTS, Cells, cells_of
from atra.rays.all_hits.contains import FARTHEST, METHODS, check_points, edge_surplus, winding_numbers
from atra.rays.all_hits.finding import MOST, Crossings, Progress
from atra.rays.all_hits.gathered import RayLayers, gathered
from atra.rays.all_hits.lists import RayHitLists
from atra.rays.geometries import joined
from atra.rays.rays import Rays, rays_of
from atra.tracing.lifetime import MeshLifetime, check_same_faces
from atra.whole_numbers import is_whole_number


class AllHitsScene(MeshLifetime, ABC):
    """Meshes, the threads that rays are traced in, and all that is found by our own tree, built when first needed."""

    def __init__(
        self,
        meshes: Mesh | Sequence[Mesh],
        transforms: ArrayLike | None,
        faces: NDArray[np.bool_] | None,
        threads: int,
    ) -> None:
        super().__init__()
        self._crossings: Crossings | None = None
        self._cells: Cells | None = None
        self._asked = 0  # points so far
        self._edges: tuple[NDArray[np.int64], NDArray[np.int64], int] | None = None
        self._met: Mesh | None = None
        geometries = joined(meshes, transforms)
        self._take(geometries.mesh)
        self.geometries, self._transforms = geometries, None if transforms is None else np.array(transforms)
        count = self.mesh.triangle_count
        if faces is not None and (np.shape(faces), np.asarray(faces).dtype) != ((count,), np.bool_):
            raise InputError(f"faces are {faces!r:.100}, expected ({count},) bool, those that rays meet")
        self._faces = None if faces is None else np.array(faces)
        self.threads = threads
        self._pool = WorkerPool(threads)

    def _take(self, mesh: Mesh) -> None:
        check_world_range(mesh)
        self.mesh, self._crossings, self._edges, self._cells, self._met = mesh, None, None, None, None

    def update(self, mesh: Mesh | Sequence[Mesh], transforms: ArrayLike | None = None) -> None:
        """Go on with other vertices of the same faces, or other transforms; None: those of before.

        What is built is built anew at once; where that fails, the next use builds again.
        Raises InputError for other faces, and what making and building a new one would; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            count = 1 if isinstance(mesh, Mesh) else len(mesh)
            if transforms is None and count == self.geometries.count:
                transforms = self._transforms
            geometries = joined(mesh, transforms)
            if not np.array_equal(geometries.firsts, self.geometries.firsts):
                raise InputError(f"there are {geometries.count} meshes, expected other vertices of the same faces")
            check_same_faces(self.geometries.own_faces(), geometries.own_faces())
            self._take(geometries.mesh)
            self.geometries, self._transforms = geometries, None if transforms is None else np.array(transforms)
            self._build_again()

    def _own(self, rays: Rays) -> Rays:
        """Rays that count from the mesh's origin, like the vertices that they meet."""
        return rays.counted_from(self.mesh.origin) if self.mesh.has_origin else rays

    @property
    def crossings(self) -> Crossings:
        """What all hits are found by, of rays and points that count from the mesh's origin. Raises ClosedError after
        `close`."""
        with self._lock:
            self._check_open()
            if self._crossings is None:
                self._crossings = Crossings(self.mesh.local, self._faces, self._pool)
            return self._crossings

    def all_hits(
        self,
        origins: Rays | ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tnear: ArrayLike | None = None,
        tfar: ArrayLike | None = None,
        max_hits: int | None = None,
        progress: Progress | None = None,
    ) -> RayHitLists:
        """All hits of every ray with tnear <= t < tfar, each triangle that a ray crosses exactly once.

        Decided without rounding for rays and vertices as stored. A ray through an edge or corner counts as moved by
        an infinitely small way, so it crosses exactly the triangles that some nearby ray crosses: a closed mesh is left
        as often as it is entered, and coplanar triangles count each. A triangle seen edge-on is not crossed.

        origins, directions, tnear, tfar: as for `intersect`. max_hits: how many to keep of each ray, the nearest; None:
        all. progress: called as progress(rays done, all rays) after each batch of 65,536.
        Raises InputError for rays that `atra.Rays` refuses and a max_hits below 1; MemoryBudgetError, before the memory
        is full, for more hits than it holds; ClosedError after `close`.
        """
        if max_hits is not None and not (is_whole_number(max_hits) and 1 <= max_hits <= MOST):
            raise InputError(f"max_hits is {max_hits!r}, expected a whole number from 1 to {MOST}, or None for all")
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            found = self.crossings.find(self._own(rays), MOST if max_hits is None else int(max_hits), progress)
            u, v = self.geometries.own_weights(found.u, found.v, found.prim_id)
            return RayHitLists(
                found.ray_splits, found.t, found.prim_id, u, v, found.truncated, shape, rays, self.geometries
            )

    def count(
        self,
        origins: Rays | ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tnear: ArrayLike | None = None,
        tfar: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> NDArray[np.int32]:
        """(N,) int32, the number of hits of every ray; arguments and errors as for `all_hits`."""
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            return self.crossings.count(self._own(rays), progress).reshape(shape)

    def gather(
        self,
        what: Reduction,
        origins: Rays | ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tnear: ArrayLike | None = None,
        tfar: ArrayLike | None = None,
        progress: Progress | None = None,
    ) -> NDArray | RayLayers:
        """All hits of each ray reduced to a number or a few.

        what: `atra.Count()`, (N,) uint32; `atra.Thickness()`, (N,) float32, the length inside closed meshes, in lengths
        of the direction; `atra.Transmittance(factors)`, (N,) float32; `atra.Layers(k)`, a `RayLayers`. Factors count
        the triangles of all meshes together.
        Other arguments and errors as for `all_hits`; InputError also for a mesh that `what` is not for.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            met = self._met_mesh()
            return gathered(what, self._own(rays), shape, self.crossings, self.geometries, met, progress)

    def _met_mesh(self) -> Mesh | None:
        """The triangles that rays meet as a mesh of their own; None where there are none."""
        if self._faces is None:
            return self.mesh
        if self._met is None and self._faces.any():
            self._met = Mesh(self.mesh.local_vertices, self.mesh.faces[self._faces], self.mesh.name)
        return self._met

    def contains(self, points: ArrayLike, *, method: str = "parity") -> NDArray[np.bool_]:
        """(P,) bool: whether points lie inside.

        points: (P, 3), taken as float64 without rounding. method: parity = the ray from a point crosses an odd number
        of triangles, decided exactly; it needs closed meshes, and where two overlap it is outside. winding = the
        generalised winding number is above one half, also for meshes with holes, whose triangles must be
        counterclockwise seen from outside; its time grows with the number of open edges.
        A point exactly on the surface may be either.
        Raises InputError for another method, points that are not finite or, with winding, beyond 1e19 in size, and a
        mesh that parity is not for, with the number of its open edges; ClosedError after `close`.
        """
        if method not in METHODS:
            raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
        found = check_points(points, FARTHEST if method == "winding" else np.inf)
        with self._lock:
            if method == "winding":
                edges, surplus, _ = self._open
                ends = self.mesh.local_vertices[edges].astype(np.float64)
                return winding_numbers(found - self.mesh.origin, ends, surplus, self.crossings) > 0.5
            if self.open_edges:
                raise InputError(
                    f"{self.mesh.name!r} is not closed: it has {self.open_edges:,} open edges, so parity says nothing; "
                    'close its holes, or pass method="winding"'
                )
            return self.parity(found)

    @property
    def open_edges(self) -> int:
        """The number of edges with an odd number of triangles; 0 where the mesh is closed."""
        return self._open[2]

    @property
    def _open(self) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        with self._lock:
            if self._edges is None:
                faces = self.mesh.faces if self._faces is None else self.mesh.faces[self._faces]
                self._edges = edge_surplus(self.mesh.local, faces)
            return self._edges

    def parity(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(P,) bool: whether a ray from each point crosses an odd number of triangles, of closed and open meshes."""
        with self._lock:
            points = points - self.mesh.origin if self.mesh.has_origin else points
            self._asked += len(points)
            if self._cells is None and self._asked >= FEWEST_POINTS and self.open_edges == 0:
                self._cells = cells_of(self.mesh.local, self._faces, self.crossings)
            if self._cells is not None:
                return self._cells.parity(points, self.crossings, self._pool)
            return (self.crossings.columns(points).counts & 1).astype(np.bool_)

    def _release(self) -> None:
        self._pool.close()
        self._crossings = self._cells = None
