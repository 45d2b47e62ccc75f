"""The plan of an aligned scene: which triangles each cell keeps, sheared onto the reference rays (paper §3.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions
from atra.alignment.culling_kernels import fill_copies
from atra.alignment.rounding import image_roundings
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_vertices
from atra.geometry.ray_space import padded_vertices, unseen_from
from atra.tracing.budgets import check_image_size, check_memory_budget
from atra.tracing.geometry import AlignedGeometry, LeftOut


def plan_aligned_geometry(
    meshes: Sequence[Mesh], alignment: Alignment, options: CellOptions, row_stride: int, pool: WorkerPool
) -> AlignedGeometry:
    """Shear a copy of every triangle for every cell; with culling, only for cells whose frustum it meets.

    meshes: what each image of the alignment sees; one mesh may appear several times. row_stride: pixels from one image
    row to the next. Culling drops a triangle only if its part in front of the eye lies outside the cell's frustum by
    more than a margin for rounding, so no hit is lost. Triangles that no ray hits are dropped (`plan_plain_geometry`).
    One counting and one filling pass go over the triangles, whatever the number of cells. Raises MemoryBudgetError
    before allocating the copies.
    """
    split = alignment.split
    check_image_size(split.height * alignment.image_count, row_stride)
    cell = (split.nx, split.ny, split.cell_width, split.cell_height)
    projected = [
        project_vertices(mesh, camera, pool, linear)
        for mesh, camera, linear in zip(meshes, alignment.cameras, alignment.linear, strict=True)
    ]
    left_out = []
    for mesh, camera, points in zip(meshes, alignment.cameras, projected, strict=True):
        roundings = image_roundings(mesh, camera, alignment, pool, points, in_every_cell=not options.culling)
        left_out.append(LeftOut.of(roundings.left_out, roundings.depth_error, points[0]))
    counts = [
        count_kept(pool, points_pixels, mesh, options.culling, cell)
        for mesh, (points_pixels, _) in zip(meshes, projected, strict=True)
    ]
    for kept, without, mesh, camera in zip(counts, left_out, meshes, alignment.cameras, strict=True):
        kept[unseen_from(camera, mesh)] = 0
        if without is not None:
            kept[without.prim_ids] = 0
    # Where the copies of each triangle start, image after image.
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    copies = int(starts[-1])
    cells = split.cell_count * alignment.image_count
    check_memory_budget(copies, cells, options.build_quality, options.memory_budget_bytes)

    vertices = padded_vertices(3 * copies)
    records = np.empty(copies, np.int64)
    first_triangle = 0
    for image, (mesh, points) in enumerate(zip(meshes, projected, strict=True)):
        own_starts = starts[first_triangle : first_triangle + mesh.triangle_count + 1]
        first_triangle += mesh.triangle_count
        place = image * split.height * row_stride, row_stride
        outputs = *place, own_starts, vertices, records
        inputs = *points, mesh.traced_faces, options.culling, *cell, *alignment.shears, *outputs
        pool.run(lambda _, counter, inputs=inputs: fill_copies(counter, *inputs))  # type: ignore[misc]
    faces = np.arange(3 * copies, dtype=np.uint32).reshape(copies, 3)
    return AlignedGeometry(vertices, faces, records, left_out=tuple(left_out))
