"""Polygons cut into triangles, in the order of the polygons."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError

_CONCAVE, _CROSSING, _BENT = 1, 2, 4
"""Bits of a polygon's shape: has to be cut by ear clipping, crosses itself, does not lie in a plane."""

_NO_TURN = 1e-9
"""Largest turn to the wrong side at a corner that counts as none, as a fraction of the polygon's area."""

_FLAT = 0.01
"""Largest distance of a corner to its polygon's plane for it to count as flat, as a fraction of the polygon's size."""

_MANY_CORNERS, _MOST_WORK = 200, 400_000_000
"""The time of ear clipping may grow with the square of a polygon's corners: upper limit of the sum of these squares,
over concave polygons of many corners. It takes up to ten seconds."""

_AT_ONCE = 1 << 16
"""Corners that are worked on at once, which bounds the memory."""


def cut_polygons(
    vertices: NDArray[np.floating], sizes: NDArray[np.int64], corners: NDArray[np.integer]
) -> tuple[NDArray[np.integer], NDArray[np.int64], list[str]]:
    """Triangles (F, 3) of polygons, the polygon (F,) of each, and notes on what was left out or is doubtful.

    vertices: (V, 3) float64, finite where used. sizes: (P,), corners of each polygon. corners: vertex indices of all
    polygons, one behind the other. A convex polygon becomes a fan from its first corner, a concave one is cut by ear
    clipping in its plane, one that crosses itself becomes a fan, too; all keep the winding. Polygons of fewer than
    three corners are left out. Raises InputError for concave polygons of too many corners.
    """
    if (sizes == 3).all():
        return corners.reshape(-1, 3), np.arange(len(sizes)), []
    vertices, first = vertices.astype(np.float64), np.cumsum(sizes) - sizes
    shapes, starts = np.zeros(len(sizes), np.uint8), np.zeros(len(sizes), np.int64)
    for size, group in _groups(sizes, 4):
        points = vertices[corners[first[group] + np.arange(size)[:, None]]]
        shapes[group], starts[group] = _shapes(np.ascontiguousarray(points.transpose(0, 2, 1)))
    clipped = _clipped(vertices, sizes, corners, first, shapes)
    counts = np.maximum(sizes - 2, 0)
    for polygon, triangles in clipped.items():
        counts[polygon] = len(triangles)
    place = np.cumsum(counts) - counts
    faces = np.empty((counts.sum(), 3), np.int64)
    for size, group in _groups(np.where(np.isin(np.arange(len(sizes)), list(clipped)), 0, sizes), 3):
        fan = [corners[first[group] + (starts[group] + k) % size] for k in range(size)]
        for k in range(size - 2):
            faces[place[group] + k] = np.stack([fan[0], fan[k + 1], fan[k + 2]], axis=1)
    for polygon, triangles in clipped.items():
        faces[place[polygon] : place[polygon] + len(triangles)] = triangles
    return faces, np.repeat(np.arange(len(sizes)), counts), list(_notes(sizes, shapes))


def _groups(sizes: NDArray[np.int64], least: int) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Sizes from `least` on, and numbers of polygons of that size, few enough to be worked on at once."""
    order = np.argsort(sizes, kind="stable")
    kinds, begins = np.unique(sizes[order], return_index=True)
    for size, begin, end in zip(kinds.tolist(), begins, [*begins[1:], len(sizes)], strict=True):
        step = max(_AT_ONCE // max(size, 1), 1)
        for start in range(begin, end, step) if size >= least else ():
            yield size, order[start : min(start + step, end)]


@np.errstate(all="ignore")
def _shapes(points: NDArray[np.float64]) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Shapes (P,) of polygons (N, 3, P) of N > 3 corners each, and the corners (P,) where their fans begin."""
    size = len(points)
    around = points - points[0]
    parts = np.stack([
        around[1:-1, (k + 1) % 3] * around[2:, (k + 2) % 3] - around[1:-1, (k + 2) % 3] * around[2:, (k + 1) % 3]
        for k in range(3)
    ], axis=1)  # fmt: skip
    normals, apart = parts.sum(axis=0), np.sqrt((parts * parts).sum(axis=1)).sum(axis=0)
    axis = np.abs(normals).argmax(axis=0)
    polygons = np.arange(len(axis))
    signed = normals[axis, polygons]
    area = np.abs(signed)
    # Seen along the axis nearest to the normal.
    ahead = [np.roll(flat, -1, axis=0) - flat for flat in (points[:, (axis + k) % 3, polygons] for k in (1, 2))]
    after = [np.roll(one, -1, axis=0) for one in ahead]
    turn = np.where(signed < 0.0, -1.0, 1.0) * (ahead[0] * after[1] - ahead[1] * after[0])
    is_inward = turn < -_NO_TURN * area
    has_no_area = area <= _NO_TURN * apart
    starts = np.zeros(len(axis), np.int64)
    if size == 4:
        is_crossing, is_concave = is_inward.sum(axis=0) > 1, False
        starts = np.where(is_inward.any(axis=0) & ~is_crossing, (turn.argmin(axis=0) + 1) % 4, 0)
    else:
        turned = np.arctan2(turn, ahead[0] * after[0] + ahead[1] * after[1]).sum(axis=0)
        is_crossing, is_concave = False, is_inward.any(axis=0) | (turned > 3.0 * np.pi)  # more than once around
    is_crossing = np.where(has_no_area, apart > 0.0, is_crossing)
    off = (around * normals).sum(axis=1)
    extent = np.ptp(points, axis=0).max(axis=0)
    is_bent = ~has_no_area & (np.ptp(off, axis=0) > 2.0 * _FLAT * extent * np.sqrt((normals * normals).sum(axis=0)))
    shapes = _CONCAVE * (is_concave & ~has_no_area) + _CROSSING * is_crossing + _BENT * is_bent
    return shapes.astype(np.uint8), np.where(is_crossing, 0, starts)


def _clipped(
    vertices: NDArray[np.floating],
    sizes: NDArray[np.int64],
    corners: NDArray[np.integer],
    first: NDArray[np.int64],
    shapes: NDArray[np.uint8],
) -> dict[int, NDArray[np.integer]]:
    """Triangles (N, 3) of concave polygons, by polygon. One that crosses itself is left out, and `shapes` says so."""
    concave = np.flatnonzero(shapes & _CONCAVE)
    large = sizes[concave][sizes[concave] > _MANY_CORNERS]
    if (large.astype(np.float64) ** 2).sum() > _MOST_WORK:
        raise InputError(f"concave polygons of up to {large.max():,} corners take too long; export them as triangles")
    clipped = {}
    for polygon in concave.tolist():
        own = corners[first[polygon] : first[polygon] + sizes[polygon]]
        triangles = _clip_ears(vertices[own])
        if triangles is None:
            shapes[polygon] |= _CROSSING
        else:
            clipped[polygon] = own[triangles]
    return clipped


def _clip_ears(points: NDArray[np.floating]) -> NDArray[np.int64] | None:
    """Corners (N, 3) of the triangles of a polygon (size, 3), seen along the axis nearest to its normal; None if they
    do not cover it, since it crosses itself."""
    from mapbox_earcut import triangulate_float64  # few files need it

    points = points - points[0]
    normal = np.cross(points[1:-1], points[2:]).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.ascontiguousarray(points[:, [(axis + 1) % 3, (axis + 2) % 3]])
    triangles = np.asarray(triangulate_float64(flat, np.array([len(flat)], np.uint32)), np.int64).reshape(-1, 3)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    covered = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    area = normal[axis]
    if not abs(np.abs(covered).sum() - abs(area)) <= 1e-6 * abs(area):
        return None
    is_turned = covered * area < 0.0
    triangles[is_turned] = triangles[is_turned][:, ::-1]
    return triangles


def _notes(sizes: NDArray[np.int64], shapes: NDArray[np.uint8]) -> Iterator[str]:
    for found, told in (
        (sizes < 3, "have fewer than 3 corners and are left out"),
        (shapes & _CROSSING != 0, "are polygons that cross themselves, and may have been meant otherwise"),
        (shapes & _BENT != 0, "are polygons that do not lie in a plane, and may have been meant otherwise"),
    ):
        if found.any():
            yield f"{found.sum():,} of {len(sizes):,} faces {told} (first: face {np.argmax(found)})"
