"""A stand-in for trimesh's ray queries.

    from atra.compat.trimesh import RayMeshIntersector
    mesh.ray = RayMeshIntersector(mesh)

Everything in trimesh that uses `mesh.ray` then uses atra: `mesh.contains`, `signed_distance`, `volume_mesh`, voxels.
Source: `trimesh.ray.ray_pyembree.RayMeshIntersector` of trimesh 5, whose arguments, shapes, dtypes and order these are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compat.trimesh_kernels import locate_hits, scale_rays
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from atra.rays.scene import RayScene

_BOX = 100.0
"""Size that a mesh is scaled to, up to a factor of two."""

_WAYS = np.array([[0.4395064455, 0.617598629942, 0.652231566745], [-0.5290, 0.3811, 0.7582]])
"""Directions in which points of open meshes are tested; the first is trimesh's."""

Located = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class _Scaled:
    """A scene of a mesh moved by -origin, then scaled. key: the mesh's hash when it was built."""

    key: int
    scene: RayScene
    origin: NDArray[np.float64]
    scale: float
    size: float


class RayMeshIntersector:
    """Ray queries of a trimesh mesh, also after it has changed; hits are found as `atra.RayScene` finds them. Rays with
    NaN, infinities or no direction hit nothing, as in trimesh.

    Parameters
    ----------
    geometry : trimesh.Trimesh
    scale_to_box : bool
        Taken and kept, as trimesh has it; queries always scale, by a power of two, which rounds nothing.
    threads : int, optional
        None: every core.

    Raises
    ------
    InputError
        By queries, for a ray that heads for the mesh from so far away, 1e9 times its size, that float64 cannot tell
        what it hits.
    """

    def __init__(self, geometry: Any, scale_to_box: bool = True, *, threads: int | None = None) -> None:
        self.mesh = geometry
        self._scale_to_box = scale_to_box
        self._threads = threads
        self._built: _Scaled | None = None

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """All hits, or the first hit of each ray. First come the first hits of all rays, then the second ones.

        Parameters
        ----------
        ray_origins, ray_directions : (N, 3) array_like of float
            Directions of any length.
        multiple_hits : bool
            False: only the first hit of each ray.

        Returns
        -------
        locations : (M, 3) float64
        index_ray, index_tri : (M,) int64

        Raises
        ------
        ValueError
            For rays of other shapes, as trimesh; InputError as the class says.
        """
        index_tri, index_ray, locations = self._hits(ray_origins, ray_directions, multiple_hits, 100, True)
        return locations, index_ray, index_tri

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]] | Located:
        """As `intersects_location`, in another order.

        Parameters
        ----------
        ray_origins, ray_directions, multiple_hits :
            As for `intersects_location`.
        max_hits : int
            Hits of a ray at most, the nearest.
        return_locations : bool

        Returns
        -------
        index_tri, index_ray : (M,) int64
        locations : (M, 3) float64
            If asked for.
        """
        found = self._hits(ray_origins, ray_directions, multiple_hits, max_hits, return_locations)
        return found if return_locations else found[:2]

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.int32]:
        """The first triangle that each ray hits: (N,) int32, -1 for none. Rays as for `intersects_location`."""
        origins, directions = _checked(ray_origins, ray_directions)
        first = np.full(len(origins), -1, np.int32)
        built = self._scene()
        if built is not None:
            found = built.scene.intersect(_scaled_rays(built, origins, directions)[0])
            first[:] = found.prim_id.view(np.int32)  # MISS, all bits set, is -1
        return first

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> NDArray[np.bool_]:
        """Whether each ray hits anything: (N,) bool. Rays as for `intersects_location`."""
        origins, directions = _checked(ray_origins, ray_directions)
        hit = np.zeros(len(origins), np.bool_)
        built = self._scene()
        if built is not None:
            hit[:] = built.scene.occluded(_scaled_rays(built, origins, directions)[0])
        return hit

    def contains_points(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points lie inside, by the parity of hits; for open meshes by that of both directions.

        Parameters
        ----------
        points : (N, 3) array_like of float

        Returns
        -------
        (N,) ndarray of bool
            False for points that are not finite.

        Raises
        ------
        ValueError
            For another shape, as trimesh.
        """
        array = np.asanyarray(points, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError("points must be (n,3)")
        contains = np.zeros(len(array), np.bool_)
        built = self._scene()
        if built is None:
            return contains
        scaled = (array - built.origin) * built.scale
        inside_box = (np.abs(scaled) <= 2.0 * built.size).all(axis=1)  # False for NaN, too
        some = scaled[inside_box]
        is_closed = built.scene.open_edges == 0
        contains[inside_box] = built.scene.contains(some) if is_closed else _probably_inside(built, some)
        return contains

    def _hits(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple: bool, max_hits: int, locate: bool
    ) -> Located:
        origins, directions = _checked(ray_origins, ray_directions)
        built = self._scene()
        if built is None or max_hits < 1 or len(origins) == 0:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3))
        rays, moved = _scaled_rays(built, origins, directions)
        if multiple:
            hits = built.scene.all_hits(rays, max_hits=int(max_hits))
            counts = np.diff(hits.ray_splits)
            nearer = np.arange(len(hits)) - np.repeat(hits.ray_splits[:-1], counts)  # hits of the ray before a hit
            order = np.argsort(nearer.astype(np.min_scalar_type(int(max_hits))), kind="stable")
            index_tri, t = hits.traced_id[order].astype(np.int64), hits.t[order].astype(np.float64)
            index_ray = np.repeat(np.arange(len(counts)), counts)[order]
        else:
            first = built.scene.intersect(rays)
            index_ray = np.flatnonzero(first.hit)
            index_tri, t = first.prim_id[index_ray].astype(np.int64), first.t[index_ray].astype(np.float64)
        locations = np.zeros((len(t) if locate else 0, 3))
        if locate:
            t = moved[index_ray] + t / built.scale
            vertices = np.ascontiguousarray(self.mesh.vertices, np.float64)
            faces = np.ascontiguousarray(self.mesh.faces, np.int64)
            normals = np.ascontiguousarray(self.mesh.face_normals, np.float64)
            locate_hits(origins, directions, index_ray, index_tri, t, vertices, faces, normals, locations)
        return index_tri, index_ray, locations

    def _scene(self) -> _Scaled | None:
        """The scene of the mesh as it is now; None where it has nothing to hit."""
        key = hash(self.mesh)
        if self._built is None or self._built.key != key:
            self._built = _built(self.mesh, key, self._threads)
        return self._built

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_built": None}

    def __copy__(self, *_: Any) -> Self:
        return type(self)(self.mesh, self._scale_to_box, threads=self._threads)

    __deepcopy__ = __copy__


def _built(mesh: Any, key: int, threads: int | None) -> _Scaled | None:
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    finite: NDArray[np.bool_] = np.isfinite(vertices.sum(axis=1))
    kept = finite[faces].all(axis=1) if len(faces) else np.zeros(0, np.bool_)
    if not kept.any():
        return None
    used = vertices[faces[kept]].reshape(-1, 3)
    low, high = used.min(axis=0), used.max(axis=0)
    size = float((high - low).max())
    scale = 2.0 ** np.floor(np.log2(_BOX / size)) if 0.0 < size < np.inf and np.isfinite(_BOX / size) else 1.0
    placed = np.clip((np.where(finite[:, None], vertices, low) - low) * scale, -1e10, 1e10)
    scene = RayScene(Mesh(placed, faces), faces=kept, touches=True, threads=threads)
    return _Scaled(key, scene, low, float(scale), float(size * scale) or 1.0)


def _checked(ray_origins: ArrayLike, ray_directions: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) float64 copies of both."""
    origins, directions = np.array(ray_origins, np.float64, order="C"), np.array(ray_directions, np.float64, order="C")
    if origins.shape != directions.shape:
        raise ValueError("Ray origin and direction don't match!")
    if origins.ndim != 2 or origins.shape[1] != 3:
        raise ValueError(f"rays have shape {origins.shape}, expected (n, 3)")
    return origins, directions


def _scaled_rays(
    built: _Scaled, origins: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[Rays, NDArray[np.float64]]:
    """The rays in the scene's space, and how far each was moved along itself; `directions` become unit vectors."""
    count = len(origins)
    placed, units = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    tfar, moved = np.empty(count, np.float32), np.empty(count)
    given = origins, directions, built.origin, built.scale, built.size
    far = scale_rays(*given, placed, units, tfar, moved)
    if far < count:
        raise InputError(
            f"ray {far} starts at {tuple(origins[far].tolist())}, over 1e9 times the size of the mesh away, where "
            "float64 cannot tell what it hits; move it closer"
        )
    return Rays(placed, units, tfar=tfar), moved


def _probably_inside(built: _Scaled, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) bool, as trimesh guesses for open meshes: where both directions agree, that; where one hits nothing, no;
    else another direction decides."""
    contains, left = np.zeros(len(points), np.bool_), np.arange(len(points))
    for way in _WAYS:
        counts = [built.scene.count(points[left], np.broadcast_to(sign * way, (len(left), 3))) for sign in (1.0, -1.0)]
        odd = [count % 2 == 1 for count in counts]
        agree = odd[0] == odd[1]
        contains[left[agree]] = odd[0][agree]
        left = left[~agree & (counts[0] > 0) & (counts[1] > 0)]
    return contains
