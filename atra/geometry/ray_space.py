"""Ray space: where rays and triangles become float32. The eye is its origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View

SMALLEST_SIZE, FARTHEST_FROM_EYE = 1e-9, 1e11
"""Least extent of a mesh and greatest distance of its box from the eye, scene units, that are traced.

The triangle test multiplies two edges and the distance from the eye, in float32. Where the product leaves its range,
pixels are wrong or missing without a word: below, from an extent of 1.5e-11 on for 180,000 triangles and later for
fewer (the smaller the edges, the sooner), above, from a distance of 2e12 on where a shear stretches the edges.
"""

NARROWEST_WORLD_PITCH = 2e-4
"""Pixel pitch down to which ray space has the world's axes, in which boxes fit walls and floors; below, the camera's.

Float32 in the world's axes moves a ray by some 1e-7 of the distance, whatever the pitch: a thousandth of a pixel here,
half a pixel at a hundredth of a degree. In the camera's axes the components across the view are small numbers, exact to
1e-7 of themselves. Where rays are parallel, the pitch is a length and says nothing of this; ray space then has the
world's axes.
"""


SMALLEST_AXIS_COMPONENT = 1e-10
"""Components of the axes of ray space that are smaller are 0, and so are those of the shears made of them.

Rays move by at most half a millionth of a pixel, a thousandth of what float32 makes of them. For instances Embree turns
the rays itself, where nothing else keeps a component from coming out tiny (SMALLEST_COMPONENT of packets).
"""


def padded_vertices(count: int) -> NDArray[np.float32]:
    """Uninitialised (count, 3) float32 whose memory goes on for 16 zero bytes, as Embree's vertex loads need."""
    memory = np.empty(count * 3 + 4, np.float32)
    memory[count * 3 :] = 0.0
    return memory[: count * 3].reshape(count, 3)


def check_range(mesh: Mesh, camera: View) -> None:
    """Raise InputError for what is no mesh or no camera, and for a mesh too small, or too far from the eye, for
    float32."""
    _check_mesh(mesh)
    if not isinstance(camera, View):
        raise InputError(f"camera is {camera!r:.100}, expected an atra.Camera or another view of atra")
    distance = float(np.abs(mesh.bounds - camera.eye).max())
    if distance > FARTHEST_FROM_EYE:
        raise InputError(
            f"{mesh.name!r} reaches {distance:g} from the eye {camera.eye}, expected at most {FARTHEST_FROM_EYE:g}: "
            "beyond, float32 loses triangles; scale mesh and camera down by the same factor, or move the eye closer"
        )
    _check_size(mesh, "scale mesh and camera up by the same factor")


def check_world_range(mesh: Mesh) -> None:
    """Raise InputError for what is no mesh, and for one too small, or too far from the world's origin, for float32 rays
    in world space."""
    _check_mesh(mesh)
    distance = float(np.abs(mesh.bounds).max())
    if distance > FARTHEST_FROM_EYE:
        raise InputError(
            f"{mesh.name!r} reaches {distance:g} from the world's origin, expected at most {FARTHEST_FROM_EYE:g}: "
            "beyond, float32 loses triangles; scale mesh and rays down by the same factor, or move them closer"
        )
    _check_size(mesh, "scale mesh and rays up by the same factor")


def _check_mesh(mesh: object) -> None:
    if not isinstance(mesh, Mesh):
        raise InputError(
            f"mesh is a {type(mesh).__module__}.{type(mesh).__name__}, expected an atra.Mesh; "
            "Mesh(vertices, faces) and Mesh.from_trimesh make one"
        )


def _check_size(mesh: Mesh, remedy: str) -> None:
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    if size < SMALLEST_SIZE and len(mesh.without_area) < mesh.triangle_count:
        raise InputError(
            f"{mesh.name!r} is {size:g} in size, expected at least {SMALLEST_SIZE:g}: below, float32 loses triangles; "
            f"{remedy}"
        )


def unseen_from(camera: View, mesh: Mesh) -> NDArray[np.int64]:
    """(N,) int64, `prim_id` of triangles that no ray hits: those without area, and where rays start at an eye, those
    with a corner at that very place, since their planes hold it. Rounding would show them, at a depth of about 0."""
    if camera.is_parallel:
        return mesh.without_area
    x, y, z = (np.float64(coordinate) for coordinate in camera.eye)
    near = np.flatnonzero(mesh.vertices[:, 0] == x)
    there = near[(mesh.vertices[near, 1] == y) & (mesh.vertices[near, 2] == z)]
    if not len(there):
        return mesh.without_area
    return np.union1d(mesh.without_area, np.flatnonzero(np.isin(mesh.faces, there).any(axis=1)))


def ray_axes(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, rows right, down, forward of the camera in ray space; orthonormal to SMALLEST_AXIS_COMPONENT."""
    if not _has_world_axes(camera):
        return np.eye(3)
    return np.where(np.abs(camera.axes) < SMALLEST_AXIS_COMPONENT, 0.0, camera.axes)


def from_eye_space(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, the rotation of eye space (the world's axes) to ray space."""
    return np.eye(3) if _has_world_axes(camera) else camera.axes


def to_ray_space(camera: View, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """World points (N, 3) -> ray space (N, 3), float64."""
    points_eye = camera.to_eye_space(points)
    return points_eye if _has_world_axes(camera) else points_eye @ camera.axes.T


def _has_world_axes(camera: View) -> bool:
    return camera.is_parallel or camera.pixel_pitch >= NARROWEST_WORLD_PITCH
