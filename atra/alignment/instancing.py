"""The plan of an aligned scene with instances: the mesh once, and one shear per cell (suggested in paper §4.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions
from atra.alignment.rounding import image_roundings
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_vertices
from atra.geometry.ray_space import from_eye_space
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, check_image_size, check_needed_bytes
from atra.tracing.geometry import AlignedGeometry, LeftOut, plan_plain_geometry

PLAN_BYTES_PER_INSTANCE = 48 + 8
"""A transform and a record."""

EMBREE_BYTES_PER_INSTANCE = 600
"""Growth of the process per instance at the peak of a build, rounded up."""


def plan_instanced_geometry(
    mesh: Mesh, alignment: Alignment, options: CellOptions, row_stride: int, pool: WorkerPool
) -> AlignedGeometry:
    """The mesh in the first camera's ray space, and a transform onto the reference rays for every part, in the order of
    `Alignment.parts`.

    Leaves out of all images the triangles that an instance would show less precisely in any of them than a ray of the
    mesh itself (`atra.alignment.rounding`). row_stride: pixels from one image row to the next. Raises MemoryBudgetError
    before allocating, InputError for an output with too many pixels.
    """
    split = alignment.split
    rows = split.height * alignment.image_count
    check_image_size(rows, row_stride)
    check_instancing_budget(mesh, split.cell_count * alignment.image_count, options)
    projected = [
        project_vertices(mesh, camera, pool, linear)
        for camera, linear in zip(alignment.cameras, alignment.linear, strict=True)
    ]
    roundings = [
        image_roundings(mesh, camera, alignment, pool, points, is_instanced=True, in_every_cell=True)
        for camera, points in zip(alignment.cameras, projected, strict=True)
    ]
    is_left_out = np.any([of_image.left_out for of_image in roundings], axis=0)
    left_out = tuple(
        LeftOut.of(is_left_out, of_image.depth_error, points[0])
        for of_image, points in zip(roundings, projected, strict=True)
    )
    plain = plan_plain_geometry(mesh, alignment.cameras[0], is_left_out)
    pixels_y = np.arange(0, rows, split.cell_height, dtype=np.int64) * row_stride
    pixels_x = np.arange(split.nx, dtype=np.int64) * split.cell_width
    records = (pixels_y[:, None] + pixels_x).reshape(-1) << 32
    return AlignedGeometry(plain.vertices, plain.faces, records, instance_transforms(alignment), left_out)


def instance_transforms(alignment: Alignment) -> NDArray[np.float32]:
    """(parts, 3, 4) float32: row-major affine transforms from the first camera's ray space to each part's reference
    rays."""
    first = alignment.cameras[0]
    transforms = alignment.transforms_from(first.eye).reshape(-1, 3, 4)
    transforms[:, :, :3] = transforms[:, :, :3] @ from_eye_space(first).T
    return transforms.astype(np.float32)


def check_instancing_budget(mesh: Mesh, instance_count: int, options: CellOptions) -> None:
    """Raise MemoryBudgetError if the mesh and its instances exceed the budget or the memory that is free now."""
    needed = len(mesh.vertices) * 12 + mesh.triangle_count * EMBREE_BYTES_PER_COPY[options.build_quality]
    needed += instance_count * (PLAN_BYTES_PER_INSTANCE + EMBREE_BYTES_PER_INSTANCE)
    what = f"{mesh.triangle_count:,} triangles and {instance_count:,} instances of them"
    check_needed_bytes(needed, options.memory_budget_bytes, what, "use fewer cells or more memory")
