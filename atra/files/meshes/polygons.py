"""Polygons cut into triangles, in the order of the polygons."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.meshes.polygons_kernels import BENT, CONCAVE, CROSSING, cut_fans

_MANY_CORNERS, _MOST_WORK = 200, 400_000_000
"""The time of ear clipping may grow with the square of a polygon's corners: upper limit of the sum of these squares,
over concave polygons of many corners. It takes up to ten seconds."""


def cut_polygons(
    vertices: NDArray[np.floating], sizes: NDArray[np.int64], corners: NDArray[np.integer]
) -> tuple[NDArray[np.integer], NDArray[np.int64], list[str]]:
    """Triangles (F, 3) of polygons, the polygon (F,) of each, and notes on what was left out or is doubtful.

    vertices: (V, 3), finite where used. sizes: (P,), corners of each polygon. corners: vertex indices of all polygons,
    one behind the other, int64 where not all are triangles. A convex polygon becomes a fan from its first corner, a
    concave one is cut by ear clipping in its plane, one that crosses itself becomes a fan, too; all keep the winding.
    Polygons of fewer than three corners are left out. Raises InputError for concave polygons of too many corners.
    """
    if (sizes == 3).all():
        return corners.reshape(-1, 3), np.arange(len(sizes)), []
    points, sizes = vertices.astype(np.float64), np.ascontiguousarray(sizes)
    counts, shapes = np.maximum(sizes - 2, 0), np.empty(len(sizes), np.uint8)
    faces = np.empty((int(counts.sum()), 3), np.int64)
    cut_fans(points, sizes, corners, shapes, faces)
    face = np.repeat(np.arange(len(sizes)), counts)
    concave = np.flatnonzero(shapes & CONCAVE)
    if len(concave):
        large = sizes[concave][sizes[concave] > _MANY_CORNERS]
        if (large.astype(np.float64) ** 2).sum() > _MOST_WORK:
            most = f"{large.max():,} corners"
            raise InputError(f"concave polygons of up to {most} take too long; export them as triangles")
        begins, places, is_there = np.cumsum(sizes) - sizes, np.cumsum(counts) - counts, np.ones(len(faces), np.bool_)
        for polygon in concave:
            own = corners[begins[polygon] : begins[polygon] + sizes[polygon]]
            triangles, place = _clip_ears(points[own]), places[polygon]
            if triangles is None:
                shapes[polygon] |= CROSSING
            else:
                faces[place : place + len(triangles)] = own[triangles]
                is_there[place + len(triangles) : place + counts[polygon]] = False
        faces, face = faces[is_there], face[is_there]
    return faces, face, list(_notes(sizes, shapes))


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
        (shapes & CROSSING != 0, "are polygons that cross themselves, and may have been meant otherwise"),
        (shapes & BENT != 0, "are polygons that do not lie in a plane, and may have been meant otherwise"),
    ):
        if found.any():
            yield f"{found.sum():,} of {len(sizes):,} faces {told} (first: face {np.argmax(found)})"
