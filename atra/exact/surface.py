"""Where the hits of an image lie on their triangles: barycentric weights, points and normals, in float64."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.intersection import intersect_pixels
from atra.exact.surface_kernels import ROWS, PixelGrid, Triangles, surface_kernel
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.prim_ids import MISS

_AT_ONCE = 1 << 18
"""Pixels of a lens whose hits are placed at once, which bounds the memory."""


def place_hits(
    kind: int,
    shape: tuple[int, ...],
    mesh: Mesh,
    camera: View,
    prim_id: NDArray[np.uint32],
    offset: tuple[float, float],
    threads: int | None,
) -> NDArray[np.float32]:
    """WEIGHTS, POINTS or NORMALS (`kind`) of an image, in an array of `shape`; NaN for misses.

    Weights and points are those of rays without a lens; points are relative to the mesh's origin. Raises InputError for
    a prim_id that the mesh does not have.
    """
    prim_id, found = read_only(np.ascontiguousarray(prim_id, np.uint32)), np.empty(shape, np.float32)
    own_mesh, own_camera = own_space(mesh, camera)
    triangles, pixels = Triangles(own_mesh.vertices, own_mesh.faces), _pixels(own_camera, prim_id.shape, offset)
    absent, kernel = np.full(1, MISS, np.uint32), surface_kernel(kind)
    pool = shared_pool(resolve_threads(threads))
    pool.run(lambda _, counter: kernel(counter, triangles, pixels, prim_id, absent, found), -(-len(prim_id) // ROWS))
    if absent[0] != MISS:
        mesh.triangles(absent)  # raises InputError naming it
    return found


def place_through_lens(
    mesh: Mesh, camera: View, prim_id: NDArray[np.uint32], offset: tuple[float, float]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Weights (2, H, W), and points (H, W, 3) around the mesh's origin, for rays that pass through no regular grid."""
    weights, points = np.full((2, *prim_id.shape), np.nan, np.float32), np.full((*prim_id.shape, 3), np.nan, np.float32)
    y, x = np.nonzero(prim_id != MISS)
    for start in range(0, len(y), _AT_ONCE):
        at = y[start : start + _AT_ONCE], x[start : start + _AT_ONCE]
        found = intersect_pixels(mesh, camera, at[1], at[0], prim_id[at], offset)
        a, b, c = np.moveaxis(mesh.local.triangles(prim_id[at]), 1, 0)
        weights[:, *at] = found.u, found.v
        points[at] = a + found.u[:, None] * (b - a) + found.v[:, None] * (c - a)
    return weights, points


def _pixels(camera: View, shape: tuple[int, ...], offset: tuple[float, float]) -> PixelGrid:
    height, width = shape
    axes = tuple(tuple(axis) for axis in camera.axes.tolist())
    if camera.lens is not None:  # normals, which need no rays, are all that kernels compute then
        return PixelGrid(camera.eye, axes, read_only(np.empty(0)), read_only(np.empty(0)), False)
    on_plane = 0 if camera.is_parallel else 1  # origins lie, or directions end, on the image plane
    columns = camera.rays(np.arange(width), np.zeros(width, int), offset)[on_plane][:, 0]
    rows = camera.rays(np.zeros(height, int), np.arange(height), offset)[on_plane][:, 1]
    return PixelGrid(camera.eye, axes, read_only(columns.copy()), read_only(rows.copy()), camera.is_parallel)


@cache
def shared_pool(threads: int) -> WorkerPool:
    """Threads that compute the surfaces of all images."""
    return WorkerPool(threads)


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A read-only view: Numba compiles read-only and writable arrays apart."""
    view = array.view()
    view.setflags(write=False)
    return view
