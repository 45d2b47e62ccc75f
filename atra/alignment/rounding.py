"""Rounding: the depth error of float32, and the triangles that sheared copies would show too imprecisely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.compiled.threads import WorkerPool
from atra.exact.rounding_kernels import COPY_MULTIPLE, INSTANCE_MULTIPLE, ParallelRays, judge_copies, judge_translations
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_vertices
from atra.geometry.ray_space import ray_axes
from atra.geometry.view import View


@dataclass(frozen=True, eq=False)
class Roundings:
    """Depth errors of float32, triangle by triangle.

    depth_error: (F,) float64, relative error of a ray of the mesh itself; inf where the plane passes through the eye.
    left_out: (F,) bool, a sheared copy may exceed the admitted error (COPY_MULTIPLE).
    """

    depth_error: NDArray[np.float64]
    left_out: NDArray[np.bool_]


def roundings_of_copies(
    mesh: Mesh,
    alignment: Alignment,
    pool: WorkerPool,
    points_pixels: NDArray[np.float64],
    points_own: NDArray[np.float64],
    points_ray: NDArray[np.float64],
    admitted_multiple: float = COPY_MULTIPLE,
    in_every_cell: bool = False,
) -> Roundings:
    """The rounding errors of a mesh seen through the cells of an alignment of pinhole cameras.

    points_pixels, points_ray: from `project_vertices`, with the image's linear map. points_own: without it, in the ray
    space of the mesh's own camera; for the first image they are the same.
    """
    depth_error, left_out = np.empty(mesh.triangle_count), np.empty(mesh.triangle_count, np.uint8)
    points = points_pixels, points_own, points_ray
    cell = alignment.split.cell_width, alignment.split.cell_height
    rest = mesh.traced_faces, *alignment.shears, *cell, admitted_multiple, in_every_cell, depth_error, left_out
    pool.run(lambda _, counter: judge_copies(counter, *points, *rest))
    return Roundings(depth_error, left_out.view(np.bool_))


def image_roundings(
    mesh: Mesh,
    camera: View,
    alignment: Alignment,
    pool: WorkerPool,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    is_instanced: bool = False,
    in_every_cell: bool = False,
) -> Roundings:
    """The rounding errors of one image's mesh; for an orthographic camera `depth_error` is 0, as there is no relative
    error near the image plane. points: from `project_vertices`, with the image's linear map. in_every_cell: there are
    copies even in cells that do not see a triangle."""
    own = points[1] if camera is alignment.cameras[0] else project_vertices(mesh, camera, pool)[1]
    multiple = INSTANCE_MULTIPLE if is_instanced else COPY_MULTIPLE
    if camera.is_parallel:
        split, left_out = alignment.split, np.empty(mesh.triangle_count, np.uint8)
        rays = _parallel_rays(camera, alignment), _parallel_rays(alignment.cameras[0], alignment)
        rest = *alignment.shears, split.cell_width, split.cell_height, is_instanced, multiple, left_out
        faces = mesh.traced_faces
        pool.run(lambda _, counter: judge_translations(counter, points[0], own, points[1], faces, *rays, *rest))
        roundings = Roundings(np.zeros(mesh.triangle_count), left_out.view(np.bool_))
    else:
        roundings = roundings_of_copies(mesh, alignment, pool, points[0], own, points[1], multiple, in_every_cell)
    roundings.left_out[mesh.without_area] = False  # no ray hits them anyway
    return roundings


def _parallel_rays(camera: View, alignment: Alignment) -> ParallelRays:
    right, down, forward = ray_axes(camera)
    plane, split = camera.plane, alignment.split
    column, row = right * plane.pitch_x, down * plane.pitch_y
    first_x, first_y = alignment.first_x_pixels, alignment.first_y_pixels
    farthest = np.abs(column) * max(abs(first_x), abs(first_x + split.cell_width))
    farthest += np.abs(row) * max(abs(first_y), abs(first_y + split.cell_height))
    middle = -np.array([float(plane.columns(0, 0.0)), float(plane.rows(0, 0.0))])
    return ParallelRays(forward, column, row, middle, farthest)
