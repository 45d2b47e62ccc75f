"""Projection of a mesh's vertices to pixels, and the number of cells that each triangle meets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection_kernels import count_copies, project_points
from atra.geometry.ray_space import from_eye_space, own_space
from atra.geometry.view import View


def count_kept(
    pool: WorkerPool, points_pixels: NDArray[np.float64], mesh: Mesh, culling: bool, cell: tuple[int, int, int, int]
) -> NDArray[np.int64]:
    """(F,) int64, the number of cells that keep each triangle: those it meets, or all without `culling`.

    A triangle without area is kept by none. points_pixels: from `project_mesh`. cell: columns, rows, width and
    height of the cells.
    """
    counts = np.full(mesh.triangle_count, cell[0] * cell[1], np.int64)
    if culling:
        pool.run(lambda _, counter: count_copies(counter, points_pixels, mesh.traced_faces, *cell, counts))
    counts[mesh.without_area] = 0
    return counts


def project_mesh(
    mesh: Mesh, camera: View, pool: WorkerPool, linear: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Project vertices to (a, b, c) with pixel position (a / c, b / c), and to ray space, both (V, 3) float64.

    c is the depth, or 1 for parallel rays. linear: (3, 3) float64, eye space to ray space, None = the camera's.
    """
    mesh, camera = own_space(mesh, camera)
    linear = from_eye_space(camera) if linear is None else linear
    shape = mesh.vertices.shape
    points_pixels, points_ray = np.empty(shape), np.empty(shape)
    constants = np.array(camera.eye), camera.to_pixels, linear
    pool.run(lambda _, counter: project_points(counter, mesh.vertices, *constants, points_pixels, points_ray))
    return points_pixels, points_ray
