"""How many pixels of each view show each triangle, and from where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.views.render_views import render_views
from atra.views.visible_points import list_cameras


@dataclass(frozen=True, eq=False)
class FaceCounts:
    """The triangles that each view shows: a sparse matrix of C views and F triangles, row by row.

    `scipy.sparse.csr_array((pixels, prim_id, view_splits), (C, F))` is the matrix.

    Attributes
    ----------
    view_splits : (C + 1,) int64
        The entries of view i are those from view_splits[i] up to view_splits[i + 1].
    prim_id : (M,) uint32
        Ascending in each view.
    pixels : (M,) int64
        Number of the view's pixels that show the triangle.
    angle : (M,) float32, optional
        Mean angle between the rays of these pixels and the triangle's normal, in radians, 0 = seen head-on.
    distance : (M,) float32, optional
        Mean length of these rays, scene units.
    face_count : int
        F.
    """

    view_splits: NDArray[np.int64]
    prim_id: NDArray[np.uint32]
    pixels: NDArray[np.int64]
    angle: NDArray[np.float32] | None
    distance: NDArray[np.float32] | None
    face_count: int

    def dense(self) -> NDArray[np.int64]:
        """(C, F) int64, pixels of each triangle in each view."""
        views = np.repeat(np.arange(len(self.view_splits) - 1), np.diff(self.view_splits))
        table = np.zeros((len(self.view_splits) - 1, self.face_count), np.int64)
        table[views, self.prim_id] = self.pixels
        return table


def face_counts(
    mesh: Mesh,
    cameras: Mapping[Any, View] | Iterable[View],
    *,
    angle: bool = False,
    distance: bool = False,
    threads: int | None = None,
) -> FaceCounts:
    """The pixels of each triangle in each view, by the rasteriser.

    Parameters
    ----------
    mesh : Mesh
    cameras : mapping or iterable of cameras
        Views of any kind, by name or in a list.
    angle, distance : bool
        Whether to find these, too.
    threads : int, optional
        None: every core.

    Returns
    -------
    FaceCounts

    Raises
    ------
    InputError
        For anything that is not a camera, and as `render_views` does.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> counts = atra.face_counts(mesh, atra.orbit(mesh, views=2, width=64, height=48))
    >>> counts.dense().shape
    (2, 1)
    """
    splits, parts = [0], []
    listed = list_cameras(cameras)
    for _, hits in render_views(mesh, listed, threads=threads):
        parts.append(_seen(hits, angle, distance))
        splits.append(splits[-1] + len(parts[-1][0]))
    empty = tuple(np.zeros(0, kind) for kind in ("u4", "i8", "f4", "f4"))
    prim_id, pixels, angles, distances = (np.concatenate(part) for part in zip(empty, *parts, strict=True))
    found = angles if angle else None, distances if distance else None
    return FaceCounts(np.array(splits), prim_id, pixels, *found, mesh.triangle_count)


def _seen(hits: Hits, angle: bool, distance: bool) -> tuple[NDArray, ...]:
    """prim_ids, pixels, mean angles and mean distances of the triangles that a view shows; no numbers unless asked."""
    seen = hits.visible_triangles()
    none = np.zeros(0, np.float32)
    if not (angle or distance):
        return seen.prim_id, seen.pixels, none, none
    y, x = np.nonzero(hits.hit)
    prim_id = hits.prim_id[y, x]
    directions = hits.camera.rays(x, y, hits.offset)[1]
    lengths = np.linalg.norm(directions, axis=1)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float32]:
        return (np.bincount(prim_id, values)[seen.prim_id] / seen.pixels).astype(np.float32)

    angles = distances = none
    if angle:
        normals = hits.normals[y, x].astype(np.float64) @ hits.camera.axes.T
        cosine = np.abs((normals * directions).sum(axis=1)) / lengths
        angles = mean(np.arccos(np.minimum(cosine, 1.0)))
    if distance:
        distances = mean(hits.depth[y, x] * lengths)
    return seen.prim_id, seen.pixels, angles, distances
