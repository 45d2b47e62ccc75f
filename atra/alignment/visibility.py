"""The plan of visible-first tracing: which copies the first pass gets, and what the second pass must rule out.

The image is divided into small tiles. A probe estimates the visible depth of each. The first pass gets the copies of
triangles that may lie nearer than that in some tile of their cell. For the rest, each tile stores the depth before
which no ray of the tile, at any sub-pixel offset, can meet them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions
from atra.alignment.rounding import roundings_of_copies
from atra.alignment.visibility_kernels import count_visible, fill_visible
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_vertices
from atra.geometry.ray_space import padded_vertices, unseen_from
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.tracing.budgets import check_image_size, check_memory_budget
from atra.tracing.geometry import AlignedGeometry, LeftOut

DEPTH_SLACK = 1e-4
"""Smallest relative margin on the depth of what is left out; a triangle's float32 error replaces it where larger."""

SEEN_SLACK = 1e-3
"""Relative margin behind the probe's depth within which copies are kept. It exceeds DEPTH_SLACK, or the surfaces that
the probe saw would fail their own test."""


PROBE_STEP = 4
"""The default probe traces a ray every PROBE_STEP pixels, across and down, along the borders of tiles."""

TILE_WIDTHS, TILE_HEIGHT = (4, 8), 4
"""Tile sizes in pixels: the resolution of the visibility estimate. Tiles hold whole packets; they are no wider than
narrow cells, because a copy is kept in every cell that its tile meets."""


@dataclass(frozen=True)
class Tiles:
    """A grid of tiles over an image. tile_width, tile_height: pixels of a tile; the last of a row or column may be cut.
    width, height: pixels of the image."""

    tile_width: int
    tile_height: int
    width: int
    height: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of tiles."""
        return -(-self.height // self.tile_height), -(-self.width // self.tile_width)


def tiles_of(split: Split) -> Tiles:
    """The tiles of an image with these cells."""
    return Tiles(TILE_WIDTHS[split.cell_width > TILE_WIDTHS[0]], TILE_HEIGHT, split.width, split.height)


def probed_depth(depth: NDArray[np.float32], tiles: Tiles) -> NDArray[np.float64]:
    """(tile rows, tile columns) float64, the second farthest of each tile's corners; of two squares in a tile, the
    farther.

    A single far corner does not count: keeping all that lies before it costs more than checking a few packets. depth:
    float32, what rays every `PROBE_STEP` pixels along the borders of tiles see.
    """
    upper, lower = (pick(depth[:-1], depth[1:]) for pick in (np.maximum, np.minimum))
    second = np.maximum(np.minimum(upper[:, :-1], upper[:, 1:]), np.maximum(lower[:, :-1], lower[:, 1:]))
    rows, columns = tiles.shape
    steps = second.reshape(rows, tiles.tile_height // PROBE_STEP, columns, tiles.tile_width // PROBE_STEP)
    return steps.max(axis=(1, 3)).astype(np.float64)


@dataclass(frozen=True, eq=False)
class VisiblePlan:
    """The geometry of the first pass, and a bound on the rest.

    nearest_hidden: (tile rows, tile columns) float32, no ray of a tile meets a left-out triangle before this depth; inf
    where none is left out.
    """

    geometry: AlignedGeometry
    nearest_hidden: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class VisibleCopies:
    """Copies that are kept. counts: (F,) int64, cells that keep each triangle. nearest_hidden: as of `VisiblePlan`.
    raster, first_cell, last_cell: as `atra.alignment.visibility_kernels` takes them."""

    counts: NDArray[np.int64]
    nearest_hidden: NDArray[np.float32]
    raster: tuple[NDArray[np.float64], int, int, int, int]
    first_cell: NDArray[np.int64]
    last_cell: NDArray[np.int64]


def visible_copies(
    mesh: Mesh,
    alignment: Alignment,
    tiles: Tiles,
    probed: tuple[NDArray[np.uint8], NDArray[np.float64]],
    points: tuple[NDArray[np.float64], NDArray[np.float64]],
    pool: WorkerPool,
) -> VisibleCopies:
    """Count the copies of every triangle for the cells in which a probe says it may be visible.

    points: from `project_vertices`, for the camera of the alignment; others as for `plan_visible_geometry`.
    """
    split, (camera,), (seen, seen_depth) = alignment.split, alignment.cameras, probed
    points_pixels, points_ray = points
    roundings = roundings_of_copies(mesh, alignment, pool, points_pixels, points_ray, points_ray)
    with np.errstate(divide="ignore"):
        wanted = (1.0 - SEEN_SLACK) / seen_depth
    columns = np.arange(tiles.shape[1]) * tiles.tile_width
    first_cell = columns // split.cell_width
    last_cell = np.minimum(columns + tiles.tile_width, camera.width) - 1
    last_cell //= split.cell_width
    raster = wanted, tiles.tile_width, tiles.tile_height, camera.width, camera.height
    slack = np.maximum(roundings.depth_error, DEPTH_SLACK)

    counts = np.empty(mesh.triangle_count, np.int64)
    hidden = np.zeros((pool.threads, *tiles.shape))

    def count(worker: int, counter: int) -> None:
        count_visible(
            counter, points_pixels, mesh.traced_faces, seen, roundings.left_out, slack, *raster, split.cell_height,
            first_cell, last_cell, hidden[worker], counts,
        )  # fmt: skip

    pool.run(count)
    counts[unseen_from(camera, mesh)] = 0
    return VisibleCopies(counts, _nearest(hidden), raster, first_cell, last_cell)


def plan_visible_geometry(
    mesh: Mesh,
    alignment: Alignment,
    tiles: Tiles,
    probed: tuple[NDArray[np.uint8], NDArray[np.float64]],
    options: CellOptions,
    *,
    row_stride: int,
    pool: WorkerPool,
) -> VisiblePlan:
    """Shear a copy of every triangle for the cells in which a probe says it may be visible.

    alignment: the cells of one image. probed: (F,) uint8, non-zero = keep the triangle in every cell it meets; and
    (tile rows, tile columns), keep what may be nearer than this (inf: everything, 0: nothing). A wrong probe costs
    time, never a hit. row_stride: pixels from one image row to the next. Raises MemoryBudgetError before allocating the
    copies.
    """
    split, (camera,), (seen, _) = alignment.split, alignment.cameras, probed
    check_image_size(split.height, row_stride)
    points = points_pixels, points_ray = project_vertices(mesh, camera, pool)
    kept = visible_copies(mesh, alignment, tiles, probed, points, pool)
    starts = np.zeros(mesh.triangle_count + 1, np.int64)
    np.cumsum(kept.counts, out=starts[1:])
    copies = int(starts[-1])
    check_memory_budget(copies, split.cell_count, options.build_quality, options.memory_budget_bytes)
    vertices = padded_vertices(3 * copies)
    records = np.empty(copies, np.int64)

    def fill(_: int, counter: int) -> None:
        fill_visible(
            counter, points_pixels, points_ray, mesh.traced_faces, seen, *kept.raster, split.cell_width,
            split.cell_height, kept.first_cell, kept.last_cell, *alignment.shears, row_stride, starts, vertices,
            records,
        )  # fmt: skip

    pool.run(fill)
    faces = np.arange(3 * copies, dtype=np.uint32).reshape(copies, 3)
    return VisiblePlan(AlignedGeometry(vertices, faces, records), kept.nearest_hidden)


def nearest_in_tiles(mesh: Mesh, camera: View, tiles: Tiles, left_out: LeftOut) -> NDArray[np.float32]:
    """(tile rows, tile columns) float32: no ray of a tile meets a left-out triangle before this depth; inf where none
    is met. For parallel rays it is 0 or inf: what is left out lies near the image plane."""
    hidden, one_cell = np.zeros(tiles.shape), np.zeros(tiles.shape[1], np.int64)
    kept_nowhere, counter = np.ones(len(left_out.prim_ids), np.bool_), np.zeros(1, np.int64)
    faces = mesh.traced_faces[left_out.prim_ids]
    faces.flags.writeable = False  # like a mesh's; Numba would compile another kernel for writable ones
    count_visible(
        counter.ctypes.data, left_out.points_pixels, faces, kept_nowhere.view(np.uint8), kept_nowhere,
        np.maximum(left_out.depth_error, DEPTH_SLACK), hidden, tiles.tile_width, tiles.tile_height,
        camera.width, camera.height, camera.height, one_cell, one_cell, hidden,
        np.empty(len(left_out.prim_ids), np.int64),
    )  # fmt: skip
    nearest = _nearest(hidden)  # for parallel rays it only tells which tiles are met
    return np.where(np.isfinite(nearest), np.float32(0.0), nearest) if camera.is_parallel else nearest


def _nearest(inverse_depth: NDArray[np.float64]) -> NDArray[np.float32]:
    """Nearest depths from the largest inverse depths of each thread, (..., tile rows, tile columns)."""
    with np.errstate(divide="ignore"):
        nearest = 1.0 / inverse_depth.reshape(-1, *inverse_depth.shape[-2:]).max(axis=0)
    return nearest.astype(np.float32)
