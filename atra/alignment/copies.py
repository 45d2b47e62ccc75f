"""What Embree is given for the cells of an alignment: a sheared copy of every triangle for each cell that it meets
(paper §3.4), or an instance of the mesh for each cell (suggested in paper §4.4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment, linear_onto
from atra.alignment.cells import CellOptions
from atra.alignment.copies_kernels import CopyTarget, fill_copies
from atra.alignment.rounding import Roundings, roundings_of_copies
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_mesh
from atra.geometry.ray_space import from_eye_space, padded_vertices, unseen_from
from atra.geometry.view import View
from atra.tracing.budgets import check_memory_budget
from atra.tracing.geometry import AlignedGeometry, LeftOut, plan_plain_geometry

Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Vertices in the homogeneous pixels of an image, and in the first camera's ray space: see `project_mesh`."""

Fill = Callable[[int, NDArray[np.int64], CopyTarget], None]
"""Writes the copies of the triangles of an image, by its number: those of triangle t from starts[t] on."""


def copied_geometry(
    meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions, row_stride: int, pool: WorkerPool
) -> AlignedGeometry:
    """Shear a copy of every triangle for every cell; with culling, only for cells whose frustum it meets.

    meshes: what each image of the alignment sees; one mesh may appear several times. row_stride: pixels from one image
    row to the next. Culling drops a triangle only if its part in front of the eye lies outside the cell's frustum by
    more than a margin for rounding, so no hit is lost. Triangles that no ray hits are dropped (`plan_plain_geometry`).
    One counting and one filling pass go over the triangles, whatever the number of cells. Raises MemoryBudgetError
    before allocating the copies.
    """
    split, culling = alignment.split, options.culling
    cells = split.nx, split.ny, split.cell_width, split.cell_height
    projected, counts, left_out = [], [], []
    for mesh, camera in zip(meshes, alignment.cameras, strict=True):
        points, roundings = _project_and_judge(mesh, camera, alignment, options, pool)
        kept = count_kept(pool, points[0], mesh, culling, cells)
        kept[unseen_from(camera, mesh)] = 0
        kept[roundings.left_out] = 0
        projected.append(points)
        counts.append(kept)
        left_out.append(LeftOut.of(roundings.left_out, roundings.depth_error, points[0]))

    def fill(image: int, starts: NDArray[np.int64], target: CopyTarget) -> None:
        triangles = *projected[image], meshes[image].traced_faces
        pool.run(lambda _, counter: fill_copies(counter, *triangles, culling, split.nx, split.ny, starts, target))

    return filled_copies(counts, fill, alignment, options, row_stride, tuple(left_out))


def filled_copies(
    counts: Sequence[NDArray[np.int64]],
    fill: Fill,
    alignment: Alignment,
    options: CellOptions,
    row_stride: int,
    left_out: tuple[LeftOut | None, ...] = (),
) -> AlignedGeometry:
    """The copies of the triangles of all images. counts: (F,) of each image, the copies of each triangle.

    Raises MemoryBudgetError before allocating them.
    """
    split = alignment.split
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    copies, cells = int(starts[-1]), split.cell_count * len(counts)
    check_memory_budget(copies, cells, options.build_quality, options.memory_budget_bytes)
    vertices, records = padded_vertices(3 * copies), np.empty(copies, np.int64)
    first = 0
    for image, own in enumerate(counts):
        pixels = split.cell_width, split.cell_height, image * split.height * row_stride, row_stride
        target = CopyTarget(*alignment.shears, *pixels, vertices, records)
        fill(image, starts[first : first + len(own) + 1], target)
        first += len(own)
    faces = np.arange(3 * copies, dtype=np.uint32).reshape(copies, 3)
    return AlignedGeometry(vertices, faces, records, left_out=left_out)


def instanced_geometry(
    mesh: Mesh, alignment: Alignment, options: CellOptions, row_stride: int, pool: WorkerPool
) -> AlignedGeometry:
    """The mesh in the first camera's ray space, and a transform onto the reference rays for every cell of every image.

    Leaves out of all images the triangles that an instance would show less precisely in any of them than a ray of the
    mesh itself (`atra.alignment.rounding`). row_stride: pixels from one image row to the next.
    """
    split = alignment.split
    judged = [_project_and_judge(mesh, camera, alignment, options, pool) for camera in alignment.cameras]
    is_left_out = np.any([roundings.left_out for _, roundings in judged], axis=0)
    left_out = tuple(LeftOut.of(is_left_out, roundings.depth_error, points[0]) for points, roundings in judged)
    plain = plan_plain_geometry(mesh, alignment.camera, is_left_out)
    rows = np.arange(0, split.height * len(judged), split.cell_height, dtype=np.int64) * row_stride
    columns = np.arange(split.nx, dtype=np.int64) * split.cell_width
    records = (rows[:, None] + columns).reshape(-1) << 32
    return AlignedGeometry(plain.vertices, plain.faces, records, instance_transforms(alignment), left_out)


def instance_transforms(alignment: Alignment) -> NDArray[np.float32]:
    """(K ny nx, 3, 4) float32: row-major affine transforms from the first camera's ray space to the reference rays,
    image by image, row by row of cells."""
    transforms = alignment.transforms.reshape(-1, 3, 4)
    transforms[:, :, :3] = transforms[:, :, :3] @ from_eye_space(alignment.camera).T
    return transforms.astype(np.float32)


def _project_and_judge(
    mesh: Mesh, camera: View, alignment: Alignment, options: CellOptions, pool: WorkerPool
) -> tuple[Points, Roundings]:
    """Project a mesh, and find the triangles that float32 would show too imprecisely in copies or instances."""
    points = project_mesh(mesh, camera, pool, linear_onto(alignment.camera, camera))
    roundings = roundings_of_copies(
        mesh, camera, alignment, points, pool, is_instanced=options.is_instanced, in_every_cell=not options.culling
    )
    roundings.left_out[mesh.without_area] = False  # no ray hits them anyway
    return points, roundings
