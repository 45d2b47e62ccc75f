"""Bounds of the error that float32 rounding may cause for a ray and a triangle, computed in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import NOISE, Pairs
from atra.exact.rounding_kernels import ALLOWED_MULTIPLE, FLOAT32_UNIT
from atra.geometry.ray_space import ray_axes, to_ray_space

ROUNDINGS = 4.0 * 2.0**-24
"""Error allowed of a depth, relative to the products that it is made of: four roundings of float32."""


@dataclass(frozen=True, eq=False)
class Rounding:
    """Bounds of float32's error for pairs of a ray and a triangle, (N,) float64 each.

    A tracer works in ray space: it rounds the corners relative to the eye, subtracts corners from each other,
    multiplies edges and ray into volumes, and takes the signs and quotients of these. Each step errs relative to the
    lengths that go in. With the distance `far` of the farthest corner, the first corner v0, edges a and b there, the
    normal n = a x b, and the ray o + t d, in units of rounding:

    corners: error of a corner's position, 4 far.
    edges: error of the volume of an edge, the eye and the direction, per length of the direction: 4 far x longest edge.
    ahead: error of n . (v0 - o): rounding of the corners, times n; rounding of n, times the way from v0 to the hit,
        since it turns the plane about v0; and NOISE of float64.
    facing: error of n . d: rounding of the direction, a sum of a column's and a row's, and three roundings more.
    depth: relative error of ahead / facing.

    The last three are multiplied by ALLOWED_MULTIPLE. As a volume approaches 0 its error does not, so hits near an edge
    and depths of planes near the eye are uncertain.
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
        if camera.lens is not None:  # directions are no sums
            summands = np.zeros_like(summands)
        first, a, b = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = np.cross(a, b)
        ahead, facing = ((normal * side).sum(axis=1) for side in (first - origins, directions))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            to_hit = np.abs(first - origins - (ahead / facing)[:, None] * directions)
        a, b, normal = np.abs(a), np.abs(b), np.abs(normal)
        to_hit = np.fmin(to_hit, np.maximum(a, b))  # hits lie in the triangle
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
