"""Several meshes in one scene, each moved by a transform if need be: joined to one mesh, whose triangles count on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range
from atra.prim_ids import MISS
from atra.tracing.lifetime import check_same_faces


@dataclass(frozen=True, eq=False)
class Geometries:
    """Several meshes as one, and which of its triangles rays meet.

    mesh: all triangles, one mesh after the other. firsts: (G + 1,) int64, the first triangle of each, then the number
    of all. is_mirrored: (G,) bool, whether the transform mirrors; such triangles have their second and third corner
    exchanged in `mesh`, so that their fronts stay outside. transforms: as given to `joined`. faces: (F,) bool, the
    triangles that rays meet; None: all.
    """

    mesh: Mesh
    firsts: NDArray[np.int64]
    is_mirrored: NDArray[np.bool_]
    transforms: NDArray[np.float64] | None = None
    faces: NDArray[np.bool_] | None = None

    @property
    def count(self) -> int:
        return len(self.firsts) - 1

    def geometry_ids(self, traced_ids: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """The mesh, (...) uint32, to which triangles of the joined mesh belong; `MISS` for `MISS`."""
        if self.count == 1:
            return np.where(traced_ids == MISS, MISS, np.uint32(0))
        found = np.searchsorted(self.firsts, traced_ids, side="right").astype(np.uint32) - np.uint32(1)
        return np.where(traced_ids == MISS, MISS, found)

    def own_ids(self, traced_ids: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """The same triangles in the numbering of their own mesh."""
        if self.count == 1:
            return traced_ids
        geometry_ids = self.geometry_ids(traced_ids)
        is_hit = geometry_ids != MISS
        firsts = self.firsts[np.where(is_hit, geometry_ids, 0)].astype(np.uint32)
        return np.where(is_hit, traced_ids - firsts, MISS)

    def exchanged(self, traced_ids: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """(...) bool, whether these triangles have their second and third corner exchanged; False for `MISS`."""
        geometry_ids = self.geometry_ids(traced_ids)
        return self.is_mirrored[np.where(geometry_ids == MISS, 0, geometry_ids)] & (geometry_ids != MISS)

    def own_weights(
        self, u: NDArray[np.float32], v: NDArray[np.float32], traced_ids: NDArray[np.uint32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Weights of the second and third corner as the triangles' own meshes number these."""
        if not self.is_mirrored.any():
            return u, v
        exchanged = self.exchanged(traced_ids)
        return np.where(exchanged, v, u), np.where(exchanged, u, v)

    @cached_property
    def met(self) -> Mesh | None:
        """The triangles that rays meet as a mesh of their own; None where there are none."""
        if self.faces is None:
            return self.mesh
        if not self.faces.any():
            return None
        return Mesh(self.mesh.local_vertices, self.mesh.faces[self.faces], self.mesh.name)

    def moved(self, meshes: Mesh | Sequence[Mesh], transforms: ArrayLike | None) -> Geometries:
        """Other vertices of the same faces, and other transforms; None: those of before. Raises InputError for other
        faces, and as `joined`."""
        count = 1 if isinstance(meshes, Mesh) else len(meshes)
        if transforms is None and count == self.count:
            transforms = self.transforms
        found = joined(meshes, transforms, self.faces)
        if not np.array_equal(found.firsts, self.firsts):
            raise InputError(f"there are {found.count} meshes, expected other vertices of the same faces")
        check_same_faces(self.own_faces, found.own_faces)
        return found

    @property
    def own_faces(self) -> Mesh:
        """The mesh with all corners in the order of the triangles' own meshes."""
        return _exchanged(self.mesh, np.repeat(self.is_mirrored, np.diff(self.firsts)))


def joined(
    meshes: Mesh | Sequence[Mesh], transforms: ArrayLike | None = None, faces: NDArray[np.bool_] | None = None
) -> Geometries:
    """One mesh, or several joined.

    transforms: (G, 3, 4) or (G, 4, 4), the affine map of each mesh into the world, applied in float64 and
    rounded once, to float32 around the origin that the joined mesh needs, if any. A map that mirrors turns the winding
    of the triangles. faces: (F,) bool, of all meshes together.
    Raises InputError for no mesh, anything else, faces of another shape or type, transforms of another shape or that
    are not finite, and a mesh smaller than 1e-9 or farther than 1e11 from the world's origin.
    """
    listed = [meshes] if isinstance(meshes, Mesh) else list(meshes) if isinstance(meshes, Sequence) else [meshes]
    if not listed or not all(isinstance(mesh, Mesh) for mesh in listed):
        raise InputError(
            f"mesh is {meshes!r:.100}, expected an atra.Mesh or a list of them; Mesh(vertices, faces) and "
            "Mesh.from_trimesh make one"
        )
    maps = None if transforms is None else _checked(transforms, len(listed))
    is_mirrored = np.zeros(len(listed), np.bool_)
    firsts = np.cumsum([0] + [mesh.triangle_count for mesh in listed])
    if maps is None and len(listed) == 1:
        mesh = listed[0]
    else:
        placed: list[NDArray] = [mesh.vertices for mesh in listed]
        if maps is not None:
            placed = [_moved(mesh, how) for mesh, how in zip(listed, maps, strict=True)]
            is_mirrored = np.linalg.slogdet(maps[:, :, :3])[0] < 0.0
        starts = np.cumsum([0] + [len(mesh.vertices) for mesh in listed])
        corners = [mesh.faces.astype(np.int64) + start for mesh, start in zip(listed, starts, strict=False)]
        mesh = Mesh(np.concatenate(placed), np.concatenate(corners), listed[0].name)
        mesh = _exchanged(mesh, np.repeat(is_mirrored, np.diff(firsts)))
    check_world_range(mesh)
    return Geometries(mesh, firsts, is_mirrored, maps, checked_faces(faces, mesh))


def checked_faces(faces: NDArray[np.bool_] | None, mesh: Mesh) -> NDArray[np.bool_] | None:
    """A copy of a choice of the mesh's triangles, (F,) bool. Raises InputError for another shape or type."""
    count = mesh.triangle_count
    if faces is not None and (np.shape(faces), np.asarray(faces).dtype) != ((count,), np.bool_):
        raise InputError(f"faces are {faces!r:.100}, expected ({count},) bool, those that rays meet")
    return None if faces is None else np.array(faces)


def _exchanged(mesh: Mesh, which: NDArray[np.bool_]) -> Mesh:
    """The mesh with the second and third corner of some triangles, (F,) bool, exchanged."""
    if not which.any():
        return mesh
    faces = np.where(which[:, None], mesh.faces[:, [0, 2, 1]], mesh.faces)
    return Mesh(mesh.vertices, faces, mesh.name)


def _moved(mesh: Mesh, transform: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(mesh.vertices @ transform[:, :3].T + transform[:, 3])


def _checked(given: ArrayLike, count: int) -> NDArray[np.float64]:
    try:
        transforms = np.array(given, np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"transforms cannot be read as an array: {error}") from None
    if transforms.ndim == 2 and count == 1:
        transforms = transforms[None]
    if transforms.shape not in ((count, 3, 4), (count, 4, 4)):
        raise InputError(f"transforms have shape {transforms.shape}, expected ({count}, 3, 4), one of each mesh")
    if not np.isfinite(transforms).all():
        which = int(np.argmin(np.isfinite(transforms).all(axis=(1, 2))))
        raise InputError(f"transform {which} is {transforms[which].tolist()}, expected finite numbers")
    if transforms.shape[1] == 4:
        last = transforms[:, 3]
        if (last != (0.0, 0.0, 0.0, 1.0)).any():
            which = int(np.argmax((last != (0.0, 0.0, 0.0, 1.0)).any(axis=1)))
            raise InputError(f"transform {which} has the last row {last[which].tolist()}, expected 0, 0, 0, 1")
    return transforms[:, :3]
