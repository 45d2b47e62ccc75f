"""What methods with cells copy, leave out and trace again, counted on a sample of a mesh's triangles."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.rounding import roundings_of_copies
from atra.alignment.second_pass import SECOND_PASS_TILE, nearest_in_tiles
from atra.alignment.visibility_kernels import TileGrid
from atra.alignment.visible_first import PROBE_STEP, probed_depth, tiles_of, visible_copies
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_mesh
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.tracing.geometry import LeftOut
from experiments.classification.bvh.binary import bvh_of
from experiments.methods.tiles_kernels import list_cells

MOST_COPIED = 1 << 15
"""Largest sample of triangles for counting copies."""

CLUSTER, MOST_CLUSTERS = 128, 8
"""Triangles that lie together, and how many such groups tell how full the leaves of a BVH are."""

SMALLEST_SCENE = 4
"""Triangles up to which a BVH of Embree is one leaf, in one block of its allocator."""

VERIFIED = 4
"""Side of the tiles of pixels whose second pass is judged as one packet's."""


class Copied(NamedTuple):
    """Estimates. copies: of triangles over all cells. left_out: triangles that float32 cannot shear. again: share of
    packets that a second pass traces through what the first left out. occupied: cells that hold a triangle; crowded:
    copies in cells of more than `SMALLEST_SCENE`; both are 0 for methods whose cells share one scene."""

    copies: float
    left_out: float
    again: float
    occupied: float = 0.0
    crowded: float = 0.0


@dataclass(frozen=True, eq=False)
class Sample:
    """Some of `total` triangles, each with corners of its own, and these corners projected. mesh: None where there are
    no triangles.

    depth: (H, W) float32, what each pixel of the view sees.
    """

    total: int
    mesh: Mesh | None
    camera: View
    depth: NDArray[np.float32]
    points: tuple[NDArray[np.float64], NDArray[np.float64]] = field(repr=False)

    @classmethod
    def of(cls, mesh: Mesh, prim_ids: NDArray[np.integer], camera: View, depth: NDArray, pool: WorkerPool) -> Self:
        """A sample of the triangles named."""
        few = apart(mesh, spread(prim_ids, MOST_COPIED)) if len(prim_ids) else None
        points = (np.empty((0, 3)), np.empty((0, 3))) if few is None else project_mesh(few, camera, pool)
        return cls(len(prim_ids), few, camera, depth, points)

    @property
    def times(self) -> float:
        """How many triangles each one stands for."""
        return 0.0 if self.mesh is None else self.total / self.mesh.triangle_count

    def in_cells(self, cells: Split) -> Copied:
        """Copies of all triangles for the cells that they meet, each of which is a scene of its own."""
        if self.mesh is None:
            return Copied(0.0, 0.0, 0.0)
        mesh, size = self.mesh, (cells.nx, cells.ny, cells.cell_width, cells.cell_height)
        with closing(WorkerPool(1)) as pool:
            starts = np.concatenate([[0], np.cumsum(self._kept(mesh, cells, True, pool))])
            met = np.empty(int(starts[-1]), np.int64)
            pool.run(lambda _, counter: list_cells(counter, self.points[0], mesh.faces, *size, starts, met))
        filled = np.bincount(met, minlength=cells.cell_count) * self.times
        crowded = filled[filled > SMALLEST_SCENE].sum()
        return Copied(float(filled.sum()), 0.0, 0.0, float(np.count_nonzero(filled)), float(crowded))

    def aligned(self, cells: Split, culling: bool = True, is_instanced: bool = False) -> Copied:
        """What aligned tracing copies for its cells, leaves out and traces again."""
        if self.mesh is None:
            return Copied(0.0, 0.0, 0.0)
        alignment = Alignment.of_cells(self.camera, cells)
        with closing(WorkerPool(1)) as pool:
            roundings = roundings_of_copies(
                self.mesh, self.camera, alignment, self.points, pool,
                is_instanced=is_instanced, in_every_cell=not culling,
            )  # fmt: skip
            roundings.left_out[self.mesh.without_area] = False
            kept = self._kept(self.mesh, cells, culling, pool)
        kept[roundings.left_out] = 0
        left_out = LeftOut.of(roundings.left_out, roundings.depth_error, self.points[0])
        again = 0.0
        if left_out is not None:
            tiles = TileGrid(*SECOND_PASS_TILE, self.camera.width, self.camera.height)
            again = self._again(tiles, nearest_in_tiles(self.mesh, self.camera, left_out))
        return Copied(float(kept.sum()) * self.times, float(roundings.left_out.sum()) * self.times, again)

    def visible(self, cells: Split) -> Copied:
        """What visible-first tracing copies after its probe, and traces again."""
        if self.mesh is None:
            return Copied(0.0, 0.0, 0.0)
        tiles = tiles_of(cells)
        with closing(WorkerPool(1)) as pool:
            alignment = Alignment.of_cells(self.camera, cells)
            counts, nearest, _ = visible_copies(self.mesh, alignment, tiles, self._probed(tiles), self.points, pool)
        return Copied(float(counts.sum()) * self.times, 0.0, self._again(tiles, nearest))

    def _kept(self, mesh: Mesh, cells: Split, culling: bool, pool: WorkerPool) -> NDArray[np.int64]:
        cell = cells.nx, cells.ny, cells.cell_width, cells.cell_height
        return count_kept(pool, self.points[0], mesh, culling, cell)

    def _probed(self, tiles: TileGrid) -> NDArray[np.float64]:
        """What a probe through the image's own pixels finds."""
        rows, columns = (
            np.minimum(np.arange(-(-pixels // side) * side // PROBE_STEP + 1) * PROBE_STEP, pixels - 1)
            for pixels, side in ((tiles.height, tiles.tile_height), (tiles.width, tiles.tile_width))
        )
        return probed_depth(self.depth[np.ix_(rows, columns)], tiles)

    @cached_property
    def _farthest(self) -> NDArray[np.float32]:
        """The farthest depth in each square of pixels, of `VERIFIED` a side."""
        rows = np.maximum.reduceat(self.depth, np.arange(0, self.depth.shape[0], VERIFIED), axis=0)
        return np.maximum.reduceat(rows, np.arange(0, self.depth.shape[1], VERIFIED), axis=1)

    def _again(self, tiles: TileGrid, nearest: NDArray[np.float32]) -> float:
        """The share of squares of pixels that see as far as what lies hidden in their tile."""
        rows, columns = (np.arange(count) * VERIFIED for count in self._farthest.shape)
        hidden = nearest[np.ix_(rows // tiles.tile_height, columns // tiles.tile_width)]
        return float(np.mean((self._farthest >= hidden) & (hidden < np.inf)))


def bytes_of_clusters(mesh: Mesh, order: NDArray[np.integer], pool: WorkerPool) -> float:
    """Bytes of our own BVH over a mesh, by one over a few groups of neighbours. order: (F,), neighbours together."""
    if not len(order):
        return 0.0
    first = spread(np.arange(0, len(order), CLUSTER), MOST_CLUSTERS)
    chosen = (first[:, None] + np.arange(CLUSTER)).ravel()
    few = apart(mesh, order[chosen[chosen < len(order)]].astype(np.int64))
    return bvh_of(few, few.vertices, pool).bytes * len(order) / few.triangle_count


def apart(mesh: Mesh, prim_ids: NDArray[np.integer]) -> Mesh:
    """A mesh of the triangles named, each with corners of its own."""
    vertices = mesh.vertices[mesh.faces[prim_ids]].reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3))


def spread(order: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """At most so many of an array, evenly spread along it."""
    if len(order) <= most:
        return order
    return order[np.linspace(0, len(order), most, endpoint=False).astype(np.int64)]
