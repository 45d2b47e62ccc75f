"""Errors of an image's depths against the planes of its triangles in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import Pairs
from atra.exact.rounding import Rounding
from atra.exact.rounding_kernels import ALLOWED_MULTIPLE, FLOAT32_UNIT
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.prim_ids import MISS

_LEAST_ROUNDINGS = 5.0
"""Least roundings of a depth: of corners, direction, the two volumes and their quotient."""


def relative_depth_error(mesh: Mesh, camera: View, image: Hits) -> NDArray[np.float64]:
    """(H, W) float64, |stored depth - t| / t for the depth t of the named triangle's plane in float64.

    NaN for a miss; inf or NaN if the ray never meets the plane. It is fast, since all pixels need it: the plane is
    normal . point = height, and the ray through (X, Y) on the image plane has points (X r, Y r, Z) with r = Z for a
    pinhole camera and 1 for parallel rays.
    """
    mesh, camera = own_space(mesh, camera)
    error = np.full(image.prim_id.shape, np.nan)
    y, x = np.nonzero(image.prim_id != MISS)
    prim_id, depth = image.prim_id[y, x], image.depth[y, x].astype(np.float64)
    used, row = _numbered(mesh, prim_id)
    corners = camera.to_camera_space(mesh.triangles(used).reshape(-1, 3)).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height, along = (normal * corners[:, 0]).sum(axis=1)[row], normal[row, 2]
    if camera.lens is not None:
        directions = camera.rays(x, y, image.offset)[1]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = height / (normal[row] * directions).sum(axis=1)
            error[y, x] = np.abs(depth - t) / np.abs(t)
        return error
    plane = camera.plane
    across = (normal[:, 0] * plane.pitch_x)[row] * plane.columns(x, image.offset[0])
    across += (normal[:, 1] * plane.pitch_y)[row] * plane.rows(y, image.offset[1])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (height - across) / along if camera.is_parallel else height / (across + along)
        error[y, x] = np.abs(depth - t) / np.abs(t)
    return error


def has_wrong_depth(mesh: Mesh, camera: View, image: Hits, error: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(H, W) bool, whether rounding of float32 cannot explain the depth's error; error: `relative_depth_error`."""
    wrong = (image.prim_id == MISS) & (image.depth != np.inf)
    y, x = np.nonzero(image.hit & ~(error <= ALLOWED_MULTIPLE * _LEAST_ROUNDINGS * FLOAT32_UNIT))
    if len(y):
        pairs = Pairs(mesh, camera, x, y, image.prim_id[y, x], image.offset)
        rounding, volumes, depth = Rounding.of(pairs), pairs.volumes, image.depth[y, x].astype(np.float64)
        with np.errstate(invalid="ignore"):  # inf x 0
            off = np.abs(depth * volumes.facing - volumes.ahead)
            excused = (depth >= 0.0) & (depth < np.inf) & (off <= rounding.ahead + depth * rounding.facing)
        wrong[y[~excused], x[~excused]] = True
    return wrong


def _numbered(mesh: Mesh, prim_id: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct `prim_id`, ascending, and the index of each pixel's among them, without sorting pixels."""
    if len(prim_id) and prim_id.max() >= mesh.triangle_count:
        mesh.triangles(prim_id)  # raises InputError naming it
    is_used = np.zeros(mesh.triangle_count, bool)
    is_used[prim_id] = True
    place = np.cumsum(is_used) - 1
    return np.nonzero(is_used)[0], place[prim_id]
