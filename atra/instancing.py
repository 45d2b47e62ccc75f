"""Plan an aligned scene without copies: the mesh once, and one shear per cell (paper §4.4 suggests it)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.alignment import Alignment
from atra.camera import Camera
from atra.culling import EMBREE_BYTES_PER_COPY, AlignedGeometry, check_image_size, check_needed_bytes
from atra.embree.scene import padded_vertices
from atra.mesh import Mesh
from atra.ray_space import ray_axes, to_ray_space

PLAN_BYTES_PER_INSTANCE = 48 + 8
"""Transform, record."""

EMBREE_BYTES_PER_INSTANCE = 600
"""Growth of the process per instance at the peak of a build, rounded up: 373 to 560 with 16,384 instances, most for low
quality. After it Embree reports 312 to 323."""


def plan_instanced_geometry(
    mesh: Mesh,
    camera: Camera,
    alignment: Alignment,
    *,
    row_stride: int,
    memory_budget_bytes: int | None = None,
    build_quality: str = "medium",
) -> AlignedGeometry:
    """The mesh itself in ray space, and for every cell the shear onto the reference rays: nothing is left out.

    Instance j nx + i is cell (i, j). row_stride: pixels from one image row to the next. Raises MemoryBudgetError before
    allocating, InputError for an image with too many pixels.
    """
    split = alignment.split
    check_image_size(camera, row_stride)
    check_instancing_budget(mesh, split.cell_count, build_quality, memory_budget_bytes)
    vertices = padded_vertices(len(mesh.vertices))
    vertices[:] = to_ray_space(camera, mesh.vertices)
    pixels_y = np.arange(split.ny, dtype=np.int64) * split.cell_height * row_stride
    pixels_x = np.arange(split.nx, dtype=np.int64) * split.cell_width
    records = (pixels_y[:, None] + pixels_x).reshape(-1) << 32
    return AlignedGeometry(vertices, mesh.faces, records, shear_transforms(camera, alignment))


def shear_transforms(camera: Camera, alignment: Alignment) -> NDArray[np.float32]:
    """(ny nx, 3, 4) float32, row-major affine transforms: the shear of cell (i, j) in ray space, at j nx + i.

    x' = x - (shift_x[i] right + shift_y[j] down) (forward . x), which is `Alignment.shear_points` in ray space's axes.
    """
    right, down, forward = ray_axes(camera)
    shifts = np.outer(alignment.shift_y, down)[:, None] + np.outer(alignment.shift_x, right)
    transforms = np.zeros((alignment.split.cell_count, 3, 4), np.float32)
    transforms[:, :, :3] = np.eye(3) - shifts.reshape(-1, 3, 1) * forward
    return transforms


def check_instancing_budget(mesh: Mesh, instance_count: int, build_quality: str, budget_bytes: int | None) -> None:
    """Raise MemoryBudgetError if the mesh and its instances would exceed the budget or the memory that is free now."""
    needed = len(mesh.vertices) * 12 + mesh.triangle_count * EMBREE_BYTES_PER_COPY[build_quality]
    needed += instance_count * (PLAN_BYTES_PER_INSTANCE + EMBREE_BYTES_PER_INSTANCE)
    what = f"{mesh.triangle_count:,} triangles and {instance_count:,} instances of them"
    check_needed_bytes(needed, budget_bytes, what, "use fewer cells or more memory")
