"""Brute force: every ray beside every triangle, without a tree or a box between."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import FLOAT64_TOLERANCE
from atra.prim_ids import MISS

_CLEAR = 1e-10
"""Distance of a line and an edge, as a share of the mesh's size, from which float64 knows the side; far above rounding
and above FLOAT64_TOLERANCE."""

_RAYS, _TRIANGLES = 64, 2048
"""Size of the blocks that are looked at together, few enough for the second-level cache."""


def near_pairs(
    origins: NDArray[np.float64], directions: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All pairs of a ray and a triangle but those whose line clearly passes the triangle by.

    origins, directions: (N, 3). corners: (F, 3, 3). Returns numbers of rays and of triangles, (M,) each, ascending.
    A line passes a triangle where it has edges on both sides: the sign of d . (p x q), p and q seen from the ray's
    origin, is a product of the line's and the edge's Plücker coordinates.
    """
    middle = corners.reshape(-1, 3).mean(axis=0, dtype=np.float64)
    corners, origins = corners - middle, origins - middle
    size = np.abs(corners).max(initial=1e-300)
    edges = []
    for p, q in zip(corners.swapaxes(0, 1), np.roll(corners, -1, axis=1).swapaxes(0, 1), strict=True):
        edge = np.concatenate([np.cross(p, q - p) / size, q - p], axis=1)
        edges.append((edge / np.maximum(np.linalg.norm(q - p, axis=1), 1e-300)[:, None]).T)
    # The weight of both halves is at most that of a direction, however far away the ray starts.
    lines = np.concatenate([directions, np.cross(origins, directions) / size], axis=1)
    reach = 1.0 + np.linalg.norm(origins, axis=1) / size
    lines /= (np.linalg.norm(directions, axis=1) * reach)[:, None]
    is_point = (corners == corners[:, :1]).all(axis=(1, 2))
    found = [np.empty((2, 0), np.int64), *_near(lines, edges, ~is_point)]
    rays, triangles = np.concatenate(found, axis=1)
    order = np.lexsort((triangles, rays))
    return rays[order], triangles[order]


def _near(
    lines: NDArray[np.float64], edges: list[NDArray[np.float64]], may_be_met: NDArray[np.bool_]
) -> Iterator[NDArray[np.int64]]:
    """Block by block."""
    for first in range(0, len(may_be_met), _TRIANGLES):
        some = slice(first, first + _TRIANGLES)
        edges_here = [np.ascontiguousarray(edge[:, some]) for edge in edges]
        for start in range(0, len(lines), _RAYS):
            a, b, c = (lines[start : start + _RAYS] @ edge for edge in edges_here)
            low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
            is_near = ((low >= -_CLEAR) | (high <= _CLEAR)) & may_be_met[some]
            yield np.argwhere(is_near).T + np.array([[start], [first]])


def nearest_of(
    count: int, rays: NDArray[np.integer], prim_ids: NDArray[np.integer], depths: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Depth and triangle of the nearest of each ray's hits, (count,) each, inf and MISS where it has none; of triangles
    at one depth, to FLOAT64_TOLERANCE, the first. rays, prim_ids, depths: (M,), rays ascending; depths inf = no hit."""
    depth, prim_id = np.full(count, np.inf), np.full(count, MISS, np.uint32)
    np.minimum.at(depth, rays, depths)
    is_nearest = np.isfinite(depths) & (depths * (1.0 - FLOAT64_TOLERANCE) <= depth[rays])
    hit, first = np.unique(rays[is_nearest], return_index=True)
    depth[hit], prim_id[hit] = depths[is_nearest][first], prim_ids[is_nearest][first]
    return depth, prim_id
