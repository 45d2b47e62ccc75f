"""The rounding of float32: how far off a tracer may be about a ray and a triangle, bounded in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import NOISE, Pairs
from atra.exact.rounding_kernels import ALLOWED_MULTIPLE, FLOAT32_UNIT
from atra.geometry.ray_space import ray_axes, to_ray_space


@dataclass(frozen=True, eq=False)
class Rounding:
    """How far off float32 may be about each pair of ray and triangle.

    A tracer subtracts the eye from the corners and rounds the result, subtracts corners from each other, multiplies the
    edges and the ray into volumes, and takes the signs and quotients of these; all that in ray space. Each step errs
    relative to the lengths that go in. With `far` the distance of the farthest corner, first corner v0, edges a and b
    at it, normal n = a x b, and the ray o + t d, in units of rounding:

    corners: 4 far; error of a corner's place.
    edges: 4 far x longest edge; error of the volume of an edge, the eye and the direction, per length of the direction.
    ahead: of n . (v0 - o). Corners, component by component, times n, as each is rounded, and the products that n is
        made of times the way from v0 to the hit: an error of n moves the plane about v0. Last, what float64 cannot
        tell from a plane that holds the eye.
    facing: of n . d, the direction being the sum of a column's and a row's, and three roundings for products and
        quotient.
    depth: relative, of their quotient: each over its volume.

    All but `corners` and `edges` are ALLOWED_MULTIPLE times that. None of these becomes less as the volume does. So a
    hit is the less certain the closer to the ray an edge passes, and a depth, the closer the plane passes to the eye.
    Source: N. J. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., SIAM 2002, chapter 3.
    """

    corners: NDArray[np.float64]
    edges: NDArray[np.float64]
    ahead: NDArray[np.float64]
    facing: NDArray[np.float64]
    depth: NDArray[np.float64]

    @classmethod
    def of(cls, pairs: Pairs) -> Rounding:
        camera, mesh = pairs.camera, pairs.mesh
        faces = mesh.traced_faces[pairs.prim_id]
        corners = to_ray_space(camera, mesh.vertices[faces].reshape(-1, 3)).reshape(-1, 3, 3)
        far = np.linalg.norm(corners, axis=2).max(axis=1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)

        axes = ray_axes(camera)
        origins, directions = (side @ axes for side in pairs.rays)
        across, along = (pairs.rays[0 if camera.is_parallel else 1][:, axis, None] * axes[axis] for axis in (0, 1))
        summands = np.abs(across) + np.abs(along if camera.is_parallel else along + axes[2])
        first, a, b = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(a, b)
        ahead, facing = ((normal * side).sum(axis=1) for side in (first - origins, directions))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            to_hit = np.abs(first - origins - (ahead / facing)[:, None] * directions)
        a, b, normal = np.abs(a), np.abs(b), np.abs(normal)
        to_hit = np.fmin(to_hit, np.maximum(a, b))  # in the triangle, whatever the plane says
        products = np.roll(a, -1, axis=1) * np.roll(b, 1, axis=1) + np.roll(a, 1, axis=1) * np.roll(b, -1, axis=1)
        places = np.abs(corners).max(axis=1) + (summands if camera.is_parallel else 0.0)
        of_ahead = ((normal * places) + products * to_hit).sum(axis=1) + pairs.volumes.reach * (NOISE / FLOAT32_UNIT)
        of_facing = (normal * (np.abs(directions) + (0.0 if camera.is_parallel else summands))).sum(axis=1)
        of_facing += 3.0 * np.abs(facing)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # inf: the depth may be any
            depth = of_ahead / np.abs(ahead) + of_facing / np.abs(facing)
        depth[np.isnan(depth)] = np.inf
        multiples = (ALLOWED_MULTIPLE * size for size in (of_ahead, of_facing, depth))
        return cls(*(FLOAT32_UNIT * size for size in (4 * far, 4 * far * longest, *multiples)))
