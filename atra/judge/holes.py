"""Holes: pixels that lack a surface because a ray slipped through between triangles that share an edge or a corner.

A ray near an edge may miss the triangle by rounding. At an open rim or a silhouette that is allowed. Inside a surface
it is not: wherever the ray is moved a little, it hits the triangle or a neighbour, so a miss, or a triangle behind, is
a hole.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import Pairs, divided, triangles_in_camera_space, volumes_of
from atra.exact.outline import OUTLINE_TOLERANCE_PIXELS
from atra.exact.rounding import Rounding
from atra.geometry.mesh import position_keys

DIRECTIONS = 24
"""Directions in which a ray is moved; a gap between neighbours below 15 degrees may stay unnoticed."""

_INSIDE = -1e-9
"""Least barycentric distance from an edge of a moved ray inside, for the rounding of float64."""

_AT_ONCE = 1 << 20
"""Pairs of rays and triangles tested at once, which bounds the memory."""


def is_closed_around(pairs: Pairs, limit: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) bool, whether each ray hits its triangle's surface nearer than `limit` wherever float32 may move it.

    limit: (N,) float64, depths, inf = none. Rays are moved by twice the tolerance of outlines, or by twice the distance
    that rounding of corners moves the triangle's edges, whichever is more. The surface is the triangle and all others
    with a corner at the position of one of its corners.
    """
    closed = np.zeros(len(pairs.prim_id), np.bool_)
    if not len(closed):
        return closed
    rows, neighbours = _neighbours(pairs)
    moves = _moves(pairs)
    step = max(_AT_ONCE // DIRECTIONS, 1)
    hit = np.zeros((len(closed), DIRECTIONS + 1), np.bool_)
    for first in range(0, len(rows), step):
        row, prim_id = rows[first : first + step], neighbours[first : first + step]
        corner, *edges = (part[:, None] for part in triangles_in_camera_space(pairs.mesh, pairs.camera, prim_id))
        origins, directions = (part[row][:, None] + 0.0 * moves[row] for part in pairs.rays)
        moved = origins if pairs.camera.is_parallel else directions
        moved += moves[row]
        found = divided(volumes_of(origins, directions, corner, edges[0], edges[1], pairs.camera.eye))
        np.logical_or.at(hit, row, (found.edge_distance >= _INSIDE) & (found.depth < limit[row, None]))
    return np.asarray(hit.all(axis=1))


def _moves(pairs: Pairs) -> NDArray[np.float64]:
    """(N, DIRECTIONS + 1, 3) float64, moves of rays on the image plane; the first is 0."""
    camera, corners = pairs.camera, pairs.corners
    direction = pairs.rays[1] / np.linalg.norm(pairs.rays[1], axis=1, keepdims=True)
    edges = corners - np.roll(corners, 1, axis=1)
    across = np.linalg.norm(np.cross(edges, direction[:, None]), axis=2)  # projected lengths
    with np.errstate(divide="ignore", invalid="ignore"):
        longer = np.linalg.norm(edges, axis=2).max(axis=1) / across.min(axis=1)
        moved = 2.0 * Rounding.of(pairs).corners * longer
        if not camera.is_parallel:
            moved /= pairs.intersections.depth
    pitch = camera.pixel_pitch if camera.lens is None else pairs.pitch.min(axis=1)
    moved = np.maximum(np.nan_to_num(moved, nan=np.inf), 2.0 * OUTLINE_TOLERANCE_PIXELS * pitch)
    moved = np.minimum(moved, 1e30)  # finite, and beyond any surface
    angles = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    ways = np.zeros((DIRECTIONS + 1, 2))
    ways[1:] = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray(moved[:, None, None] * (ways @ pairs.across))


def _neighbours(pairs: Pairs) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(M,) indices of pairs, and (M,) prim_ids of their triangles and those that touch them, some twice."""
    faces, keys = pairs.mesh.faces, position_keys(pairs.mesh)
    own = keys[faces[pairs.prim_id]]
    wanted, place = np.unique(own, return_inverse=True)
    found = np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)
    is_wanted = wanted[found] == keys
    near = np.flatnonzero(is_wanted[faces].any(axis=1))
    corner = faces[near]
    at, which = np.nonzero(is_wanted[corner])
    key = found[corner[at, which]]
    order = np.argsort(key, kind="stable")
    touching = near[at[order]]
    starts = np.searchsorted(key[order], np.arange(len(wanted) + 1))
    place = place.reshape(-1)
    counts = np.diff(starts)[place]
    rows = np.repeat(np.repeat(np.arange(len(own)), 3), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return rows, touching[np.repeat(starts[:-1][place], counts) + within]
