"""The tie rule: of triangles hit at the same depth the lowest prim_id wins, for every method.

Float32 cannot decide ties: the last digits of a depth depend on the order of a triangle's corners, the shear, and the
packets. But triangles tie over an area only where they overlap in one plane. These triangles are found once per mesh
and the tiles of the image that may show them once per view; pixels there are decided in float64 after tracing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import MemoryBudgetError
from atra.exact.settling_kernels import MANY, settle_ties
from atra.exact.ties_kernels import (
    PLANE_NUMBER_ROUNDING,
    PLANE_TOLERANCE,
    TILE,
    find_overlaps,
    mark_ties,
    number_places,
    number_planes,
)
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View

TIE_TOLERANCE = 1e-9
"""Relative difference up to which two float64 depths are equal."""

MOST_LISTED = 1 << 22
"""Places in the lists of tiles at most; with more, pixels are tested against all partners."""

MOST_PAIRS = 1 << 24
"""Upper limit of a mesh's overlapping pairs, equal triangles not counted; more would take too long."""


@dataclass(frozen=True, eq=False)
class CoplanarOverlaps:
    """The triangles that can tie: for each triangle the lower ones that overlap it in its plane.

    may_tie: (F + 1,) uint8, 1 if there are any; the last entry stands for a miss and is 0.
    twins: (F,) uint32, the lowest triangle with the same three corners in any order, mostly the triangle itself.
    starts: (F + 1,) uint32, and partners: (P,) uint32, the lower triangles: those of triangle t are
    partners[starts[t]:starts[t + 1]], ascending. Twins are represented by their lowest triangle.
    concerned: (N,) uint32, ascending, the triangles of all pairs.
    pairs: (P, 2) uint32, indices into `concerned`: each triangle with its partners, and with itself if it has twins. A
    tie is visible only where both are.
    """

    may_tie: NDArray[np.uint8]
    twins: NDArray[np.uint32]
    starts: NDArray[np.uint32]
    partners: NDArray[np.uint32]
    concerned: NDArray[np.uint32]
    pairs: NDArray[np.uint32]

    @cached_property
    def crowd(self) -> NDArray[np.int64]:
        """(C,) int64, ascending, indices into `concerned`: the partners of triangles that have more than MANY."""
        with_many = np.bincount(self.pairs[:, 0], minlength=len(self.concerned)) > MANY
        return np.unique(self.pairs[with_many[self.pairs[:, 0]], 1]).astype(np.int64)


@dataclass(frozen=True, eq=False)
class TieTiles:
    """Where a view may show ties.

    marked: (tile rows, tile columns) bool, the tiles that may show one. firsts: (tiles + 1,) int64, and listed: (N,)
    uint32: the partners of triangles with more than MANY that tile t may show are listed[firsts[t]:firsts[t + 1]],
    ascending. firsts is empty if nothing is listed.
    """

    marked: NDArray[np.bool_]
    firsts: NDArray[np.int64]
    listed: NDArray[np.uint32]

    @classmethod
    def of(cls, marked: NDArray[np.bool_]) -> TieTiles:
        """Without lists."""
        return cls(marked, np.empty(0, np.int64), np.empty(0, np.uint32))

    @property
    def any(self) -> bool:
        """Whether a tie may be visible at all."""
        return bool(self.marked.any())


_found: WeakKeyDictionary[Mesh, CoplanarOverlaps] = WeakKeyDictionary()


def coplanar_overlaps(mesh: Mesh) -> CoplanarOverlaps:
    """The triangles that can tie, found at the first call and kept as long as the mesh.

    Triangles lie in one plane if they do to a billionth of their size. Neighbours that share only an edge or a corner
    do not overlap, nor do triangles without area and needles ten million times as long as wide.
    Raises MemoryBudgetError for more than MOST_PAIRS pairs.
    """
    overlaps = _found.get(mesh)
    if overlaps is None:
        overlaps = _found[mesh] = _find(mesh.local)
    return overlaps


def keep_overlaps(mesh: Mesh, overlaps: CoplanarOverlaps) -> None:
    """Keep the result of `coplanar_overlaps` for an equal mesh, so that it is not computed again."""
    _found[mesh] = overlaps


def _find(mesh: Mesh) -> CoplanarOverlaps:
    prim_ids, runs = _plane_runs(mesh)
    corners = mesh.triangles(prim_ids)
    places = np.empty(len(prim_ids), np.int64)
    number_places(corners.mean(axis=1), mesh.bounds[0], mesh.bounds[1] - mesh.bounds[0], places)
    order = np.lexsort((prim_ids, places, runs))
    prim_ids, runs, corners = prim_ids[order].astype(np.uint32), runs[order], corners[order]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    low, high = corners.min(axis=1), corners.max(axis=1)
    sizes = (high - low).max(axis=1)
    slack = PLANE_TOLERANCE * sizes[:, None]
    leaves = 1 << max(len(prim_ids) - 1, 0).bit_length()
    boxes = np.empty((2 * leaves, 2, 4))
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    boxes[leaves : leaves + len(prim_ids), 0] = np.column_stack([low - slack, runs])
    boxes[leaves : leaves + len(prim_ids), 1] = np.column_stack([high + slack, runs])
    twins = np.arange(mesh.triangle_count, dtype=np.uint32)
    pairs = find_overlaps(prim_ids, corners, normals, sizes, boxes, twins, MOST_PAIRS)
    if len(pairs) > MOST_PAIRS:
        raise MemoryBudgetError(
            f"{mesh.name!r} has more than {MOST_PAIRS} pairs of triangles that overlap in one plane, too many to "
            'decide all ties; trace it with ties "any"'
        )
    own = twins[pairs] == pairs  # a partner may have turned out to be a twin later
    pairs = pairs[own.all(axis=1)]
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    counts = np.bincount(pairs[:, 0], minlength=mesh.triangle_count)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.uint32)
    may_tie = np.zeros(mesh.triangle_count + 1, np.uint8)
    may_tie[:-1] = (np.arange(mesh.triangle_count) != twins) | (counts[twins] > 0)
    with_twins = np.unique(twins[np.arange(mesh.triangle_count) != twins])
    seen_together = np.concatenate([pairs, np.column_stack([with_twins, with_twins])])
    concerned, places = np.unique(seen_together, return_inverse=True)
    return CoplanarOverlaps(
        may_tie, twins, starts, pairs[:, 1].copy(), concerned, places.reshape(-1, 2).astype(np.uint32)
    )


def _plane_runs(mesh: Mesh) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Triangles that may share a plane with others, (N,) prim_ids, and the number of each one's run, (N,).

    Different planes may have the same number by accident; `find_overlaps` tells them apart.
    """
    numbers = np.empty(mesh.triangle_count)
    number_planes(mesh.vertices, mesh.faces, mesh.bounds.mean(axis=0), mesh.bounds[1] - mesh.bounds[0], numbers)
    order = np.argsort(numbers)
    order = order[: len(order) - np.isnan(numbers).sum()]  # NaN comes last
    run = np.cumsum(np.diff(numbers[order], prepend=-np.inf) > PLANE_NUMBER_ROUNDING, dtype=np.int64)
    shared = np.bincount(run)[run] > 1
    return order[shared], run[shared]


def tie_tiles(mesh: Mesh, camera: View) -> TieTiles:
    """The tiles of the image in which a tie may be visible, at any sub-pixel offset.

    A pair can tie only where its triangles' bounding rectangles on the image overlap. A triangle that reaches behind
    the eye may be anywhere.
    """
    overlaps = coplanar_overlaps(mesh)
    mesh, camera = own_space(mesh, camera)
    rows, columns = -(-camera.height // TILE), -(-camera.width // TILE)
    if not len(overlaps.pairs):
        return TieTiles.of(np.zeros((rows, columns), np.bool_))
    if camera.lens is not None:  # straight edges are bent, and bounding rectangles with them
        return TieTiles.of(np.ones((rows, columns), np.bool_))
    size, boxes = np.array([camera.width, camera.height], np.float64), np.empty((len(overlaps.concerned), 4), np.int64)
    marks = np.zeros((rows + 1, columns + 1), np.int64)
    mark_ties(
        mesh.vertices, mesh.faces, overlaps.concerned, overlaps.pairs,
        np.array(camera.eye), camera.to_pixels, size, boxes, marks,
    )  # fmt: skip
    marked = np.asarray(np.cumsum(np.cumsum(marks, axis=0), axis=1)[:-1, :-1] > 0)
    return _listed(marked, overlaps.concerned[overlaps.crowd], boxes[overlaps.crowd])


def _listed(marked: NDArray[np.bool_], prim_ids: NDArray[np.uint32], boxes: NDArray[np.int64]) -> TieTiles:
    """List the triangles that marked tiles may show. boxes: (N, 4), first and last column and row of tiles."""
    wide, high = boxes[:, 1] - boxes[:, 0] + 1, boxes[:, 3] - boxes[:, 2] + 1
    counts = np.maximum(wide, 0) * np.maximum(high, 0)
    if not 0 < counts.sum() <= MOST_LISTED:
        return TieTiles.of(marked)
    which = np.repeat(np.arange(len(boxes)), counts)
    down, right = np.divmod(np.arange(len(which)) - (np.cumsum(counts) - counts)[which], wide[which])
    tiles = (boxes[which, 2] + down) * marked.shape[1] + boxes[which, 0] + right
    seen = marked.reshape(-1)[tiles]
    tiles, which = tiles[seen], which[seen]
    firsts = np.concatenate([[0], np.cumsum(np.bincount(tiles, minlength=marked.size))]).astype(np.int64)
    return TieTiles(marked, firsts, prim_ids[which[np.argsort(tiles, kind="stable")]])


def lowest_of_ties(
    mesh: Mesh,
    camera: View,
    tiles: TieTiles,
    offset: tuple[float, float],
    prim_id: NDArray[np.uint32],
    pool: WorkerPool,
    directions: NDArray[np.float64] | None = None,
) -> None:
    """Replace tied triangles in `prim_id` (H, W) by the lowest ones, in place.

    A partner of the stored triangle replaces it if the ray hits the partner, edges included, at the same depth to
    `TIE_TOLERANCE`, in float64. Depths are not changed: they are of the same plane.
    tiles: from `tie_tiles` for this mesh and camera. directions: (3, H, W) float64, camera space, of a camera with a
    lens.
    """
    overlaps, across, along = coplanar_overlaps(mesh), np.empty(0), np.empty(0)
    mesh, camera = own_space(mesh, camera)
    if camera.lens is None:
        plane = camera.plane
        across = plane.columns(np.arange(camera.width), offset[0]) * plane.pitch_x
        along = plane.rows(np.arange(camera.height), offset[1]) * plane.pitch_y
    rays = np.array(camera.eye), camera.axes, across, along, directions, camera.is_parallel

    def work(_: int, counter: int) -> None:
        settle_ties(
            counter, tiles.marked, overlaps.may_tie, overlaps.twins, overlaps.starts, overlaps.partners,
            tiles.firsts, tiles.listed, mesh.vertices, mesh.faces, *rays, TIE_TOLERANCE, prim_id,
        )  # fmt: skip

    pool.run(work)
