"""Ray space: the space with the eye at its origin in which rays and triangles become float32."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.lenses.models import bends_rays
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector
from atra.geometry.view import View, check_view

Seen = TypeVar("Seen", bound=View)
"""A kind of camera."""

SMALLEST_IN_VIEW = 1e-12
"""Least size of a mesh as a share of its distance from the eye: float64 then has 4,500 steps across it."""

SMALLEST_SIZE, FARTHEST_FROM_EYE = 1e-9, 1e11
"""Limits of the meshes that are traced: least extent, and greatest distance from the eye, scene units.

The triangle test multiplies two edges and the distance from the eye in float32. Beyond these limits the product leaves
float32's range, and pixels are silently wrong or missing.
"""

NARROWEST_WORLD_PITCH = 2e-4
"""Pixel pitch from which on ray space has the world's axes; below, it has the camera's.

In the world's axes bounding boxes fit walls and floors, but float32 moves a ray by 1e-7 of the distance, which is half
a pixel in very narrow views. In the camera's axes the components across the view are small numbers with small errors.
For parallel rays, whose pitch is a length, ray space has the world's axes.
"""

SMALLEST_AXIS_COMPONENT = 1e-10
"""Smaller components of the axes of ray space, and of shears, are replaced by 0, which moves no ray visibly.

For instances Embree transforms the rays, and nothing else prevents tiny components (`packets_kernels`).
"""


def own_space(mesh: Mesh, camera: Seen) -> tuple[Mesh, Seen]:
    """A mesh and its camera with the mesh's origin moved to that of the world; themselves where it has none.

    All that reads both starts here, and so reads float32 vertices. Eyes near the mesh are moved without rounding: up to
    as far from it as it is from the world's origin, or where they have no finer digits than float64 has at that
    distance. Other eyes move by at most 2^-53 of their distance, which `check_range` keeps below 1e-3 of a mesh's size.
    """
    return (mesh.local, camera.counted_from(mesh.origin)) if mesh.has_origin else (mesh, camera)


def padded_vertices(count: int) -> NDArray[np.float32]:
    """Uninitialised (count, 3) float32, followed by 16 zero bytes that Embree's vertex loads need."""
    memory = np.empty(count * 3 + 4, np.float32)
    memory[count * 3 :] = 0.0
    return memory[: count * 3].reshape(count, 3)


def check_range(mesh: Mesh, camera: View, takes_lenses: bool = False) -> None:
    """Raise InputError unless these are a mesh and a view, and the mesh is large and near enough for float32; and for a
    camera with a lens unless the method takes it."""
    _check_mesh(mesh)
    check_view(camera)
    if camera.lens is not None and not takes_lenses:
        raise InputError(f"this method needs rays through a regular grid on a plane, but {bends_rays(camera.lens)}")
    size, distance = _check_extent(mesh, camera.eye, f"the eye {camera.eye}", "mesh and camera", "the eye")
    if size < SMALLEST_IN_VIEW * distance and len(mesh.without_area) < mesh.triangle_count:
        raise InputError(
            f"{mesh.name!r} is {size:g} in size and {distance:g} from the eye {camera.eye}, expected at least "
            f"{SMALLEST_IN_VIEW:g} of the distance: float64 cannot resolve it from there; move the eye closer"
        )


def check_world_range(mesh: Mesh) -> None:
    """Raise InputError unless this is a mesh that is large enough and near enough to the origin for float32."""
    _check_mesh(mesh)
    _check_extent(mesh, (0.0, 0.0, 0.0), "the world's origin", "mesh and rays", "them")


def _check_mesh(mesh: object) -> None:
    if not isinstance(mesh, Mesh):
        raise InputError(
            f"mesh is a {type(mesh).__module__}.{type(mesh).__name__}, expected an atra.Mesh; "
            "Mesh(vertices, faces) and Mesh.from_trimesh make one"
        )


def _check_extent(mesh: Mesh, place: Vector, called: str, scaled: str, moved: str) -> tuple[float, float]:
    """Size of a mesh, and distance to its farthest corner. Raises InputError for those that float32 cannot hold."""
    size, distance = float((mesh.bounds[1] - mesh.bounds[0]).max()), float(np.abs(mesh.bounds - place).max())
    if distance > FARTHEST_FROM_EYE:
        raise InputError(
            f"{mesh.name!r} reaches {distance:g} from {called}, expected at most {FARTHEST_FROM_EYE:g}: float32 would "
            f"lose triangles; scale {scaled} down by the same factor, or move {moved} closer"
        )
    if size < SMALLEST_SIZE and len(mesh.without_area) < mesh.triangle_count:
        raise InputError(
            f"{mesh.name!r} is {size:g} in size, expected at least {SMALLEST_SIZE:g}: float32 would lose triangles; "
            f"scale {scaled} up by the same factor"
        )
    return size, distance


def unseen_from(camera: View, mesh: Mesh) -> NDArray[np.int64]:
    """(N,) int64, `prim_id` of triangles that no ray hits but rounding might show: those without area, and for a
    pinhole camera those with a corner at the eye."""
    mesh, camera = own_space(mesh, camera)
    if camera.is_parallel:
        return mesh.without_area
    x, y, z = (np.float64(coordinate) for coordinate in camera.eye)
    near = np.flatnonzero(mesh.vertices[:, 0] == x)
    there = near[(mesh.vertices[near, 1] == y) & (mesh.vertices[near, 2] == z)]
    if not len(there):
        return mesh.without_area
    return np.union1d(mesh.without_area, np.flatnonzero(np.isin(mesh.faces, there).any(axis=1)))


def ray_axes(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, rows right, down, forward of the camera in ray space, orthonormal to SMALLEST_AXIS_COMPONENT."""
    if not _has_world_axes(camera):
        return np.eye(3)
    return np.where(np.abs(camera.axes) < SMALLEST_AXIS_COMPONENT, 0.0, camera.axes)


def from_eye_space(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, the rotation from eye space, which has the world's axes, to ray space."""
    return np.eye(3) if _has_world_axes(camera) else camera.axes


def to_ray_space(camera: View, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Transform world points (N, 3) to ray space, (N, 3) float64."""
    points_eye = camera.to_eye_space(points)
    return points_eye if _has_world_axes(camera) else points_eye @ camera.axes.T


def _has_world_axes(camera: View) -> bool:
    return camera.is_parallel or camera.pixel_pitch >= NARROWEST_WORLD_PITCH
