"""Rounding: the depth error of float32, and the triangles that sheared copies would show too imprecisely."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.compiled.threads import WorkerPool
from atra.exact.rounding_kernels import COPY_MULTIPLE, INSTANCE_MULTIPLE, ParallelRays, judge_copies, judge_translations
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_mesh
from atra.geometry.ray_space import ray_axes
from atra.geometry.view import View


class Roundings(NamedTuple):
    """Depth errors of float32, triangle by triangle.

    depth_error: (F,) float64, relative error of a ray of the mesh itself; inf where the plane passes through the eye, 0
    for parallel rays, as there is no relative error near the image plane. left_out: (F,) bool, a sheared copy may
    exceed the admitted error (COPY_MULTIPLE).
    """

    depth_error: NDArray[np.float64]
    left_out: NDArray[np.bool_]


def roundings_of_copies(
    mesh: Mesh,
    camera: View,
    alignment: Alignment,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    pool: WorkerPool,
    *,
    is_instanced: bool = False,
    in_every_cell: bool = False,
) -> Roundings:
    """The rounding errors of a mesh seen by a camera of an alignment.

    points: from `project_mesh`, with the image's map onto the first camera's ray space (`linear_onto`).
    in_every_cell: there are copies even in cells that do not see a triangle.
    """
    own = points[1] if camera is alignment.camera else project_mesh(mesh, camera, pool)[1]
    split, multiple = alignment.split, INSTANCE_MULTIPLE if is_instanced else COPY_MULTIPLE
    depth_error, left_out = np.zeros(mesh.triangle_count), np.empty(mesh.triangle_count, np.uint8)
    triangles, cells = (points[0], own, points[1], mesh.traced_faces), (split.cell_width, split.cell_height)
    if camera.is_parallel:
        rays = _parallel_rays(camera, alignment), _parallel_rays(alignment.camera, alignment)
        rest = *rays, *alignment.shears, *cells, is_instanced, multiple, left_out
        pool.run(lambda _, counter: judge_translations(counter, *triangles, *rest))
    else:
        bounds = *alignment.shears, *cells, multiple, in_every_cell, depth_error, left_out
        pool.run(lambda _, counter: judge_copies(counter, *triangles, *bounds))
    return Roundings(depth_error, left_out.view(np.bool_))


def _parallel_rays(camera: View, alignment: Alignment) -> ParallelRays:
    right, down, forward = ray_axes(camera)
    plane, split, (first_x, first_y) = camera.plane, alignment.split, alignment.corner_pixels
    column, row = right * plane.pitch_x, down * plane.pitch_y
    farthest = np.abs(column) * max(abs(first_x), abs(first_x + split.cell_width))
    farthest += np.abs(row) * max(abs(first_y), abs(first_y + split.cell_height))
    middle = -np.array([float(plane.columns(0, 0.0)), float(plane.rows(0, 0.0))])
    return ParallelRays(forward, column, row, middle, farthest)
