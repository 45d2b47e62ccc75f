"""The plan of an aligned scene: which triangles each cell keeps, sheared onto the reference rays (paper §3.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.rounding import Roundings, roundings_of_copies, roundings_of_translations
from atra.errors import InputError, MemoryBudgetError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import from_eye_space, padded_vertices, to_ray_space, unseen_from
from atra.geometry.view import View
from atra.kernels.planning import count_copies, fill_copies, project_points
from atra.kernels.rounding import COPY_MULTIPLE, INSTANCE_MULTIPLE
from atra.options import AlignedOptions, CellOptions
from atra.parallel import WorkerPool

PLAN_BYTES_PER_COPY = 3 * 12 + 12 + 8
"""Vertices, indices, record."""

EMBREE_BYTES_PER_COPY = {"low": 110, "medium": 110, "high": 160}
"""Growth of the process per triangle at the peak of a build, rounded up."""


LEFT_OUT_BY_EMBREE = np.float32(3e38)
"""A coordinate with which a triangle does not get into the BVH; Embree's limit is 1.8e18."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Triangles of one image that are left out of its copies.

    prim_ids: (N,) int64, ascending. depth_error: (N,) float64, how far off a ray of the mesh itself may be, relative.
    points_pixels: (V, 3) float64, the mesh in the homogeneous pixels of the image.
    """

    prim_ids: NDArray[np.int64]
    depth_error: NDArray[np.float64]
    points_pixels: NDArray[np.float64]

    @classmethod
    def of(
        cls, is_left_out: NDArray[np.bool_], roundings: Roundings, points_pixels: NDArray[np.float64]
    ) -> LeftOut | None:
        """Those where `is_left_out`, (F,) bool, or None if there are none."""
        prim_ids = np.flatnonzero(is_left_out)
        return cls(prim_ids, roundings.depth_error[prim_ids], points_pixels) if len(prim_ids) else None


@dataclass(frozen=True, eq=False)
class AlignedGeometry:
    """Sheared copies of a mesh's triangles, or the mesh and a shear per cell, ready for Embree.

    vertices: (3 N, 3) float32, three of its own per copy. faces: (N, 3) uint32.
    records: (N,) int64, what the filter needs of a copy: its prim_id in the mesh (low 32 bits) and the distance in
    pixels from the reference cell's pixel to its cell's (high 32 bits, rows `row_stride` pixels apart, image below
    image); empty where no filter reads them.
    transforms: (I, 3, 4) float32, a row-major shear per instance, or None. With them the triangles are the mesh's own
    (`vertices` (V, 3), `faces` (F, 3)), and `records` is (I,), of which only the high halves are read.
    left_out: of each image what no copy may show (`atra.alignment.rounding`), to be traced pixel by pixel; None where
    nothing is.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    records: NDArray[np.int64]
    transforms: NDArray[np.float32] | None = None
    left_out: tuple[LeftOut | None, ...] = ()

    @property
    def copy_count(self) -> int:
        """Triangles that Embree is given."""
        return len(self.faces)


def plan_plain_geometry(mesh: Mesh, camera: View, is_left_out: NDArray[np.bool_] | None = None) -> AlignedGeometry:
    """The mesh itself in ray space, `prim_id` for `prim_id`, without records; is_left_out: (F,) bool, without those.

    Triangles that no ray hits (`unseen_from`) get corners so far away that Embree leaves them out: its triangle test,
    fused multiplications in float32, may show them beside where they are.
    """
    vertices = padded_vertices(len(mesh.vertices) + 1)
    vertices[:-1] = to_ray_space(camera, mesh.vertices)
    vertices[-1] = LEFT_OUT_BY_EMBREE
    faces = mesh.traced_faces
    unseen = unseen_from(camera, mesh)
    if len(unseen) or is_left_out is not None:
        faces = faces.copy()
        faces[unseen] = len(mesh.vertices)
        faces[is_left_out if is_left_out is not None else slice(0)] = len(mesh.vertices)
    return AlignedGeometry(vertices, faces, np.empty(0, np.int64))


def plan_aligned_geometry(
    meshes: Sequence[Mesh], alignment: Alignment, options: AlignedOptions, row_stride: int, pool: WorkerPool
) -> AlignedGeometry:
    """Shear a copy of every triangle for every cell, or with culling only for the cells whose frustum it meets.

    Triangles that no ray hits are left out (`plan_plain_geometry`).
    meshes: what each image of the alignment sees; the same one may stand there several times.
    A triangle is left out of a cell only if its part in front of the eye lies outside the cell's frustum by more than
    a margin that absorbs rounding, so no hit is lost. One counting and one filling pass over the triangles, whatever
    the number of cells.

    row_stride: pixels from one image row to the next. Raises MemoryBudgetError before allocating the copies.
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
        roundings = image_roundings(mesh, camera, alignment, pool, points)
        left_out.append(LeftOut.of(roundings.left_out, roundings, points[0]))
    counts = [
        count_kept(pool, points_pixels, mesh, options.culling, cell)
        for mesh, (points_pixels, _) in zip(meshes, projected, strict=True)
    ]
    for kept, without, mesh, camera in zip(counts, left_out, meshes, alignment.cameras, strict=True):
        kept[unseen_from(camera, mesh)] = 0
        if without is not None:
            kept[without.prim_ids] = 0
    # One after the other: the copies of triangle t of image k start at its place in this list.
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    copies = int(starts[-1])
    check_memory_budget(copies, split.cell_count * alignment.image_count, options)

    vertices = padded_vertices(3 * copies)
    records = np.empty(copies, np.int64)
    first_triangle = 0
    for image, (mesh, points) in enumerate(zip(meshes, projected, strict=True)):
        own_starts = starts[first_triangle : first_triangle + mesh.triangle_count + 1]
        first_triangle += mesh.triangle_count
        place = image * split.height * row_stride, row_stride
        _fill(pool, points, mesh, options.culling, cell, alignment.shears, place, own_starts, vertices, records)
    faces = np.arange(3 * copies, dtype=np.uint32).reshape(copies, 3)
    return AlignedGeometry(vertices, faces, records, left_out=tuple(left_out))


def image_roundings(
    mesh: Mesh,
    camera: View,
    alignment: Alignment,
    pool: WorkerPool,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    is_instanced: bool = False,
) -> Roundings:
    """The roundings of one image's mesh; points: of `project_vertices`, as they are sheared."""
    own = points[1] if camera is alignment.cameras[0] else project_vertices(mesh, camera, pool)[1]
    multiple = INSTANCE_MULTIPLE if is_instanced else COPY_MULTIPLE
    if camera.is_parallel:
        roundings = roundings_of_translations(
            mesh, camera, alignment, pool, points[0], own, points[1],
            is_instanced=is_instanced, admitted_multiple=multiple,
        )  # fmt: skip
    else:
        roundings = roundings_of_copies(mesh, alignment, pool, points[0], own, points[1], multiple)
    roundings.left_out[mesh.without_area] = False  # that is so whatever they are traced with
    return roundings


def count_kept(
    pool: WorkerPool, points_pixels: NDArray[np.float64], mesh: Mesh, culling: bool, cell: tuple[int, int, int, int]
) -> NDArray[np.int64]:
    """(F,) int64, the cells that keep each triangle: those it meets, or without `culling` all; none if it has no area.

    points_pixels: of `project_vertices`. cell: columns, rows, width and height of the cells.
    """
    counts = np.full(mesh.triangle_count, cell[0] * cell[1], np.int64)
    if culling:
        pool.run(lambda _, counter: count_copies(counter, points_pixels, mesh.traced_faces, *cell, counts))
    counts[mesh.without_area] = 0
    return counts


def _fill(
    pool: WorkerPool,
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    mesh: Mesh,
    culling: bool,
    cell: tuple[int, int, int, int],
    shears: tuple[NDArray[np.float64], NDArray[np.float64]],
    place: tuple[int, int],
    starts: NDArray[np.int64],
    vertices: NDArray[np.float32],
    records: NDArray[np.int64],
) -> None:
    """place: first pixel of the image in the output, and pixels from one row to the next."""
    rest = (*cell, *shears, *place, starts, vertices, records)
    pool.run(lambda _, counter: fill_copies(counter, *points, mesh.traced_faces, culling, *rest))


def check_memory_budget(copies: int, cell_count: int, options: CellOptions) -> None:
    """Raise MemoryBudgetError if so many copies would exceed the budget, the memory that is free now, or the 2^32
    vertices Embree can number."""
    if 3 * copies >= 2**32:
        raise MemoryBudgetError(f"{copies:,} triangle copies over {cell_count:,} cells are more than Embree can index")
    needed = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY[options.build_quality])
    what = f"{copies:,} triangle copies over {cell_count:,} cells"
    check_needed_bytes(needed, options.memory_budget_bytes, what, "use fewer cells, culling, or more memory")


def check_needed_bytes(needed: int, budget_bytes: int | None, what: str, cure: str) -> None:
    """Raise MemoryBudgetError if `needed` bytes exceed the budget or the memory that is free now.

    what: the thing that needs them, in the plural; cure: what to do. budget_bytes: None for no budget.
    """
    free = psutil.virtual_memory().available
    for which, limit in (("the memory budget is", budget_bytes), ("the machine has free only", free)):
        if limit is not None and needed > limit:
            raise MemoryBudgetError(
                f"{what} need about {needed / 2**30:.1f} GiB, {which} {limit / 2**30:.1f} GiB; {cure}"
            )


def check_image_size(rows: int, row_stride: int) -> None:
    """Raise InputError if the output has more pixels, rows `row_stride` apart, than a record can count."""
    if rows * row_stride >= 2**31:
        raise InputError(f"an output of {rows} rows of {row_stride} pixels is too large, expected below 2^31 pixels")


def check_image_memory(rows: int, width: int) -> None:
    """Raise MemoryBudgetError if the depth and prim_id of so many pixels are more than the memory that is free."""
    what = f"depth and prim_id of {rows:,} rows of {width:,} pixels"
    check_needed_bytes(rows * width * 8, None, what, "use fewer pixels, or more memory")


def project_vertices(
    mesh: Mesh, camera: View, pool: WorkerPool, linear: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vertices -> (V, 3) float64 (a, b, c) with pixel position (a / c, b / c), and their ray space, (V, 3) float64.

    c is the depth, or 1 where rays are parallel. linear: (3, 3) float64, eye space -> ray space (None: the camera's).
    """
    linear = from_eye_space(camera) if linear is None else linear
    shape = mesh.vertices.shape
    points_pixels, points_ray = np.empty(shape), np.empty(shape)
    constants = np.array(camera.eye), camera.to_pixels, linear
    pool.run(lambda _, counter: project_points(counter, mesh.vertices, *constants, points_pixels, points_ray))
    return points_pixels, points_ray
