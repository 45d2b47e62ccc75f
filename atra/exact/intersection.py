"""Intersections of pixels' rays with triangles' planes in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View

Components: TypeAlias = Sequence[NDArray[np.float64]] | NDArray[np.float64]
"""The x, y and z of vectors, arrays of one shape."""

NOISE = 1e-14
"""Size of a volume, relative to the product of its lengths, up to which it counts as 0: fifty roundings of float64."""

FLOAT64_TOLERANCE = 1e-12
"""Tolerance of what float64 decides: lying inside a triangle, barycentric, and being equally deep, relative."""


@dataclass(frozen=True, eq=False)
class Intersections:
    """The intersections of rays i with the planes of triangles i.

    depth: (N,) float64, along the view axis, scene units, > 0; inf = never hit.
    u, v: (N,) float64 barycentric weights of the second and third corner, not clipped; NaN = never hit.
    edge_distance: (N,) float64, min(u, v, 1 - u - v): negative beside the triangle; -inf = never hit.

    A ray *never hits* a triangle without area, nor one whose plane is parallel to the ray, behind its origin, or
    contains its origin to the rounding of float64: of distances in the triangle, and of the eye's own coordinates.
    """

    depth: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    edge_distance: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Volumes:
    """The signed volumes, times six, of a ray o + t d and a triangle c, c + e1, c + e2, with normal n = e2 x e1.

    All are float64 arrays of one shape.
    facing: d . n, zero for a triangle edge-on.
    ahead: (c - o) . n; the depth is ahead / facing.
    u, v: the barycentric weights of the second and third corner are u / facing and v / facing.
    size, reach: |d| |e1| |e2| and |(c - o, eye)| |e1| |e2|, to which the rounding of `facing` and of `ahead` is
    relative: the eye's coordinates were rounded before they were subtracted.

    Source: T. Möller, B. Trumbore, "Fast, minimum storage ray/triangle intersection", J. Graphics Tools 2(1), 1997.
    """

    facing: NDArray[np.float64]
    ahead: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    size: NDArray[np.float64]
    reach: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of a pixel's ray and a triangle; derived values are in camera space, float64.

    mesh, camera: as given, then with the mesh's origin moved to that of the world (`own_space`).
    x, y, prim_id: (N,) integers, the ray of pixel (x, y) at sub-pixel `offset`, and its triangle.
    First use raises InputError for a bad offset and a `prim_id` that the mesh does not have.
    """

    mesh: Mesh
    camera: View
    x: NDArray[np.integer]
    y: NDArray[np.integer]
    prim_id: NDArray[np.integer]
    offset: tuple[float, float]

    def __getitem__(self, chosen: NDArray) -> Pairs:
        """The pairs that an array of indices or a mask chooses."""
        return replace(self, x=self.x[chosen], y=self.y[chosen], prim_id=self.prim_id[chosen])

    def __post_init__(self) -> None:
        mesh, camera = own_space(self.mesh, self.camera)
        self.__dict__.update(mesh=mesh, camera=camera)

    @cached_property
    def rays(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and directions, (N, 3) each."""
        return self.camera.rays(self.x, self.y, self.offset)

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """(N, 3, 3), corners: triangle, corner, axis."""
        corners = self.mesh.triangles(self.prim_id).reshape(-1, 3)
        return self.camera.to_camera_space(corners).reshape(-1, 3, 3)

    @cached_property
    def depths(self) -> NDArray[np.float64]:
        """(N, 3), depths of the corners: where a plane across the view axis, or across the ray of a lens, meets it."""
        if self.camera.lens is None:
            return self.corners[..., 2]
        directions = self.rays[1]
        along = (self.corners * directions[:, None]).sum(axis=2)
        return np.asarray(along / (directions**2).sum(axis=1)[:, None])

    @cached_property
    def across(self) -> NDArray[np.float64]:
        """(N, 2, 3), two unit vectors that a ray is moved along: those of the image plane, or across a lens's ray."""
        if self.camera.lens is None:
            return np.broadcast_to(np.eye(3)[:2], (len(self.x), 2, 3))
        directions = self.rays[1]
        least = np.eye(3)[np.abs(np.nan_to_num(directions)).argmin(axis=1)]
        first = np.cross(directions, least)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(directions, first)
        return np.stack([first, second / np.linalg.norm(second, axis=1, keepdims=True)], axis=1)

    @cached_property
    def pitch(self) -> NDArray[np.float64]:
        """(N, 2), width of a pixel along those at depth 1, for a lens the smaller way to the pixel's two borders."""
        camera = self.camera
        if not isinstance(camera, LensView):
            return np.broadcast_to([camera.plane.pitch_x, camera.plane.pitch_y], (len(self.x), 2))
        ways = []
        for axis in range(2):
            near, far = ([self.offset[0], self.offset[1]] for _ in range(2))
            near[axis], far[axis] = 0.25, 0.75
            start, end = (camera.rays(self.x, self.y, (one[0], one[1]))[1] for one in (near, far))
            turned = np.linalg.norm(np.cross(self.rays[1], end - start), axis=1)
            ways.append(2.0 * turned / np.linalg.norm(self.rays[1], axis=1))
        width = np.fmin(*ways)
        width[np.isnan(width)] = camera.pixel_pitch
        return np.stack([width, width], axis=1)

    @cached_property
    def volumes(self) -> Volumes:
        corner, edge_1, edge_2 = triangles_in_camera_space(self.mesh, self.camera, self.prim_id)
        return volumes_of(*self.rays, corner, edge_1, edge_2, self.camera.eye)

    @cached_property
    def intersections(self) -> Intersections:
        return divided(self.volumes)


def intersect_pixels(
    mesh: Mesh,
    camera: View,
    x: NDArray[np.integer],
    y: NDArray[np.integer],
    prim_id: NDArray[np.integer],
    offset: tuple[float, float] = (0.5, 0.5),
) -> Intersections:
    """Intersect the ray of each pixel (x, y) with the plane of its triangle `prim_id` in float64.

    x, y, prim_id: (N,) integers. Raises InputError for a bad offset or a `prim_id` that the mesh does not have.
    """
    return Pairs(mesh, camera, x, y, prim_id, offset).intersections


def triangles_in_camera_space(
    mesh: Mesh, camera: View, prim_id: NDArray[np.integer]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """First corner and the two edges leaving it, camera space, (N, 3) float64 each.

    Edges are subtracted before the rotation, exactly: triangles without area, and coplanar ones, stay so.
    """
    corners = mesh.triangles(prim_id)
    first = corners[:, 0]
    return (
        camera.to_camera_space(first),
        (corners[:, 1] - first) @ camera.axes.T,
        (corners[:, 2] - first) @ camera.axes.T,
    )


def volumes_of(
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    corner: NDArray[np.float64],
    edge_1: NDArray[np.float64],
    edge_2: NDArray[np.float64],
    eye: Sequence[float] = (0.0, 0.0, 0.0),
) -> Volumes:
    """The volumes of rays and triangles; every argument is (N, 3), or (3,) if it is the same for all. eye: what was
    subtracted from all positions."""
    # As components: numpy's own cross product takes several times as long for the few rays of a small image.
    o, d, e1, e2 = (np.moveaxis(one, -1, 0) for one in (origins - corner, directions, edge_1, edge_2))
    p, q = _cross(d, e2), _cross(o, e1)
    area = _dot(e1, e1) * _dot(e2, e2)
    size, reach = np.sqrt(_dot(d, d) * area), np.sqrt((_dot(o, o) + np.dot(eye, eye)) * area)
    return Volumes(_dot(p, e1), _dot(e2, q), _dot(p, o), _dot(d, q), size, reach)


def divided(volumes: Volumes) -> Intersections:
    """The intersections that volumes give; a volume below NOISE counts as 0."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        u, v, depth = (volume / volumes.facing for volume in (volumes.u, volumes.v, volumes.ahead))
    never = (np.abs(volumes.facing) <= NOISE * volumes.size) | (np.abs(volumes.ahead) <= NOISE * volumes.reach)
    never |= ~(depth > 0.0)
    u = np.where(never, np.nan, u)
    v = np.where(never, np.nan, v)
    edge_distance = np.where(never, -np.inf, np.minimum(np.minimum(u, v), 1.0 - u - v))
    return Intersections(np.where(never, np.inf, depth), u, v, edge_distance)


def _cross(a: Components, b: Components) -> Components:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Components, b: Components) -> NDArray[np.float64]:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def intersect_rays(
    mesh: Mesh, origins: NDArray[np.floating], directions: NDArray[np.floating], prim_id: NDArray[np.integer]
) -> Intersections:
    """Intersect each ray with the plane of its triangle `prim_id` in float64; `depth` is in units of the direction.

    origins, directions: (N, 3), world space. prim_id: (N,) integers. Raises InputError for an unknown `prim_id`.
    """
    corners = mesh.local.triangles(prim_id)
    first, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
    rays = origins.astype(np.float64) - mesh.origin, directions.astype(np.float64)
    return divided(volumes_of(*rays, first, edges[:, 0], edges[:, 1]))
