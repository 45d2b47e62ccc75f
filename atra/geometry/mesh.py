"""Meshes: the triangles that are traced."""

from __future__ import annotations

import warnings
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.origins import around_origin

# The triangle test multiplies three lengths in float32; beyond this limit the product overflows and triangles silently
# vanish from the image. The limit of the distance to the eye is `ray_space.FARTHEST_FROM_EYE`.
LARGEST_COORDINATE = 1e12
"""Upper limit of a coordinate's size."""

_FACTORS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd factors of the hash of a position."""

_LONGER_PRODUCT = 4.0
"""A needle is a triangle whose two edges at the first corner have a product beyond this multiple of the least such."""


class Mesh:
    """Indexed triangles in world space; the arrays are C-contiguous, read-only copies. Degenerate triangles are kept.

    Parameters
    ----------
    vertices : (V, 3) array of real numbers
        Scene units. Kept as float32; as float64 for a mesh with an origin.
    faces : (F, 3) array of whole numbers
        Vertex indices; row i is the triangle with `prim_id` i. Kept as uint32.
    name : str
        The mesh's name in messages and records.
    units : str, optional
        The unit of length that its file states, such as "inch".
    notes : tuple of str
        What reading its file left out, or what is doubtful.

    Attributes
    ----------
    origin : (3,) float64
        Where the stored vertices count from: zero, or where float32 would move a vertex by more than 1e-7 of the mesh's
        size, as at map coordinates, a point near its middle. All that is asked and answered stays in world space.
    has_origin : bool
        Whether the origin is another than zero.
    local_vertices : (V, 3) float32
        Vertices less the origin, as they are stored.

    Raises
    ------
    InputError
        For a wrong shape or dtype, no triangle, the first coordinate that is not finite or beyond 1e12 in size, and the
        first face with an index outside the vertices.

    Warns
    -----
    UserWarning
        Of a mesh that spans so much that float32 changes its short edges by more than a twentieth even so.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> mesh.triangle_count
    1
    >>> mesh.bounds.tolist()
    [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
    """

    faces: NDArray[np.uint32]
    name: str
    units: str | None
    notes: tuple[str, ...]
    origin: NDArray[np.float64]
    has_origin: bool
    local_vertices: NDArray[np.float32]

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        name: str = "mesh",
        units: str | None = None,
        notes: tuple[str, ...] = (),
    ) -> None:
        given = _checked_vertices(vertices)
        checked = _checked_faces(faces, len(given))
        local, origin, loss = around_origin(given, checked)
        if loss:
            warnings.warn(f"mesh {name!r} {loss}", stacklevel=2)
        kept = {"name": name, "units": units, "notes": notes, "has_origin": bool(origin.any())}
        self.__setstate__(kept | {"local_vertices": local, "origin": origin, "faces": checked})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name} cannot be set: a mesh does not change; make another one", name=name, obj=self)

    def __getstate__(self) -> dict[str, Any]:
        return {name: kept for name, kept in self.__dict__.items() if name not in ("vertices", "_moved")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for name in ("local_vertices", "origin", "faces", "traced_faces"):  # those of copies and pickles are writable
            if name in state:
                state[name].setflags(write=False)

    @cached_property
    def vertices(self) -> NDArray[np.floating]:
        """(V, 3) float32, scene units, world space; float64 for a mesh with an origin."""
        if not self.has_origin:
            return self.local_vertices
        vertices = self.local_vertices + self.origin
        vertices.setflags(write=False)
        return vertices

    @property
    def local(self) -> Mesh:
        """The mesh with its origin moved to that of the world, sharing its arrays; itself where it has none."""
        return self._moved if self.has_origin else self

    @cached_property
    def _moved(self) -> Mesh:
        moved = copy(self)
        moved.__dict__.pop("bounds", None)
        moved.__dict__.update(origin=np.zeros(3), has_origin=False)
        return moved

    @classmethod
    def from_trimesh(cls, mesh: Any, name: str = "mesh") -> Self:
        """The triangles of a `trimesh.Trimesh`, in their order.

        Parameters
        ----------
        mesh : trimesh.Trimesh
            Anything with arrays `vertices` and `faces`.
        name : str
            The mesh's name in messages and records.

        Raises
        ------
        InputError
            For anything else, and as `Mesh`.
        """
        if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            raise InputError(
                f"mesh is a {type(mesh).__name__}, expected a trimesh.Trimesh; of a Scene take `to_mesh()`"
            )
        return cls(mesh.vertices, mesh.faces, name)

    def __repr__(self) -> str:
        return f"Mesh({self.name!r}, {self.triangle_count:,} triangles, {len(self.local_vertices):,} vertices)"

    @property
    def triangle_count(self) -> int:
        """F, triangles without area included."""
        return len(self.faces)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64, lowest and highest corner of the box around all vertices of faces."""
        is_used = np.zeros(len(self.local_vertices), np.bool_)
        is_used[self.faces] = True
        axes = self.local_vertices.T.copy()  # one axis at a time is faster
        axes[:, ~is_used] = axes[:, self.faces[0, :1]]
        return np.stack([axes.min(axis=1), axes.max(axis=1)]).astype(np.float64) + self.origin

    @cached_property
    def without_area(self) -> NDArray[np.int64]:
        """(N,) int64, ascending, `prim_id` of the triangles without area, which no ray hits."""
        corners = self.local_vertices.astype(np.float64)[self.faces]
        # Differences of float32 values and their products are exact in float64, or nearly so.
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.flatnonzero((normals == 0.0).all(axis=1))

    @cached_property
    def traced_faces(self) -> NDArray[np.uint32]:
        """(F, 3) uint32, faces as Embree is given them: in needles the longest edge lies opposite the first corner.

        Embree's test multiplies the two edges at the first corner, and for two long edges of a needle float32 makes the
        product inaccurate (docs/methods.md, Rounding). Other triangles are unchanged: the halves of a square, which
        share their longest edge, are then tested there with equal numbers, and no ray slips through.
        """
        corners = [self.local_vertices[self.faces[:, corner]].astype(np.float64) for corner in range(3)]
        lengths = np.stack([np.linalg.norm(corners[i - 2] - corners[i - 1], axis=1) for i in range(3)], axis=1)
        product = lengths.prod(axis=1)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            at_corner = product / lengths  # of the two edges there
        first = np.argmax(lengths, axis=1)
        best = np.take_along_axis(at_corner, first[:, None], axis=1)[:, 0]
        first[~(at_corner[:, 0] > _LONGER_PRODUCT * best)] = 0
        turned = np.take_along_axis(self.faces, (first[:, None] + np.arange(3)) % 3, axis=1)
        turned.setflags(write=False)
        return turned

    def triangles(self, prim_id: NDArray[np.integer]) -> NDArray[np.float64]:
        """The corners of triangles.

        Parameters
        ----------
        prim_id : (N,) array of whole numbers
            Numbers of triangles.

        Returns
        -------
        (N, 3, 3) float64
            Triangle, corner, axis; world space, scene units.

        Raises
        ------
        InputError
            Naming the first `prim_id` that this mesh does not have.
        """
        prim_id = np.asarray(prim_id)
        absent = (prim_id < 0) | (prim_id >= self.triangle_count)
        if absent.any():
            raise InputError(
                f"prim_id {prim_id[absent].flat[0]} is not in {self.name!r}, which has {self.triangle_count} triangles"
            )
        corners = self.local_vertices[self.faces[prim_id]].astype(np.float64)
        return corners + self.origin if self.has_origin else corners


def unit_normals(mesh: Mesh, prim_ids: NDArray[np.integer]) -> NDArray[np.float64]:
    """(N, 3) float64, unit normals of triangles, towards where their corners are counterclockwise; NaN without area."""
    corners = mesh.local.triangles(prim_ids)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(invalid="ignore"):
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _checked_vertices(given: ArrayLike) -> NDArray[Any]:
    vertices = _as_array("vertices", given)
    if vertices.size == 0:
        raise InputError("the mesh has no vertices, expected at least one triangle")
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise InputError(f"vertices have shape {vertices.shape}, expected (V, 3)")
    if vertices.dtype.kind not in "iuf":
        raise InputError(f"vertices have dtype {vertices.dtype}, expected real numbers")
    extremes = np.array([vertices.min(), vertices.max()], np.float64)
    if not (np.abs(extremes) <= LARGEST_COORDINATE).all():  # False for NaN and inf, too
        good = np.abs(vertices.astype(np.float64)) <= LARGEST_COORDINATE
        index = int(np.nonzero(~good.all(axis=1))[0][0])
        value = tuple(float(c) for c in vertices[index])
        raise InputError(
            f"vertex {index} is {value}, expected finite numbers of at most {LARGEST_COORDINATE:g} in size"
        )
    return vertices


def _checked_faces(given: ArrayLike, vertex_count: int) -> NDArray[np.uint32]:
    faces = _as_array("faces", given)
    if faces.size == 0:
        raise InputError("the mesh has no faces, expected at least one triangle")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(f"faces have shape {faces.shape}, expected (F, 3): triangles")
    if faces.dtype.kind not in "iu":
        raise InputError(f"faces have dtype {faces.dtype}, expected whole numbers")
    if faces.min() < 0 or faces.max() >= vertex_count:
        bad = (faces < 0) | (faces >= vertex_count)
        face, corner = (int(i) for i in np.argwhere(bad)[0])
        raise InputError(f"face {face} names vertex {faces[face, corner]}, but the mesh has {vertex_count} vertices")
    return np.array(faces, np.uint32, order="C")


def _as_array(name: str, given: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array: {error}") from None


def position_keys(mesh: Mesh) -> NDArray[np.uint64]:
    """(V,) uint64 hashes, equal for vertices at the same position."""
    places = mesh.local_vertices + np.float32(0.0)  # no -0.0
    mixed: NDArray[np.uint64] = (places.view(np.uint32).astype(np.uint64) * _FACTORS).sum(axis=1, dtype=np.uint64)
    return mixed
