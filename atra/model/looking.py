"""One cheap look at a mesh and a view: a raster frame, boxes along sampled rays, copies of sampled triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import thread_time
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.compiled.instruction_sets import native_lanes
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.projection import count_kept, project_vertices
from atra.geometry.ray_space import check_range, unseen_from
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.model.looking_kernels import LEVELS, RAYS, SIDE, count_along_rays
from atra.raster.frames import Scratch, compile_kernels, draw_frame
from atra.tracing.images import outputs
from atra.tracing.options import native_packet_widths
from atra.tracing.rays import ray_grid
from atra.trees.building import Draft, bound_triangles

STRATA = 8
"""Blocks of sampled rays along each side of the image."""

MOST_IN_TREE, MOST_COPIED = 1 << 18, 1 << 15
"""Largest samples of triangles: for the tree, and for counting copies."""

SMALLEST_COMPONENT = np.float32(1e-18)
"""Smaller components of directions count as this, as 0 has no reciprocal."""

BROKEN = 0.05
"""Share of the depth by which what a tile of 4 x 4 pixels sees must differ for the tile to show an edge."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Some of `total` triangles, each with corners of its own, and those projected; None of none."""

    total: int
    mesh: Mesh | None
    points_pixels: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Mesh, prim_ids: NDArray[np.integer], camera: View, pool: WorkerPool) -> Self:
        """A sample of the triangles named."""
        few = apart(mesh, _spread(prim_ids, MOST_COPIED)) if len(prim_ids) else None
        points = np.empty((0, 3)) if few is None else project_vertices(few, camera, pool)[0]
        return cls(len(prim_ids), few, points)

    def copies(self, cells: Split) -> float:
        """Copies of all triangles for the cells that they meet."""
        if self.mesh is None:
            return 0.0
        pool = WorkerPool(1)
        cell = cells.nx, cells.ny, cells.cell_width, cells.cell_height
        kept = count_kept(pool, self.points_pixels, self.mesh, True, cell)
        pool.close()
        return float(kept.sum()) * self.total / self.mesh.triangle_count


@dataclass(frozen=True, eq=False)
class Look:
    """What the model knows of a mesh and a view.

    width, height: of the image, pixels. triangles: of the mesh. in_view: triangles in clusters that the view may show.
    shapes: (columns, rows) of packets. boxes: (shapes, 2, LEVELS) float64, boxes of each level of a binary SAH tree
    that a packet of that shape enters, on average over the sample: along the whole ray, and up to what it sees. tested:
    (shapes, 2), triangles in the leaves entered. met: (shapes, 2), triangles that a packet hits. hit: share of rays
    that hit anything. edges: share of tiles of 4 x 4 pixels across which depth jumps. raster_s: processor seconds of
    the raster frame on one thread. raster_bytes: of its clusters. samples: of all triangles, and of those seen.
    """

    width: int
    height: int
    triangles: int
    in_view: int
    is_parallel: bool
    shapes: tuple[tuple[int, int], ...]
    boxes: NDArray[np.float64]
    tested: NDArray[np.float64]
    met: NDArray[np.float64]
    hit: float
    edges: float
    raster_s: float
    raster_bytes: int
    samples: tuple[Sample, Sample] = field(repr=False)

    def copies(self, split: tuple[int, int], culling: bool = True, visible: bool = False) -> float:
        """Copies of triangles over all cells of a split, estimated from a sample; visible: of those seen alone."""
        cells = Split(*split, self.width, self.height)
        if not culling:
            return float(self.triangles * cells.cell_count)
        return self.samples[visible].copies(cells)

    def shape(self, shape: tuple[int, int]) -> int:
        """The place of a shape in `shapes`."""
        return self.shapes.index(shape)


def look_at(mesh: Mesh, camera: View) -> Look:
    """Look at a mesh from a camera, on one thread. Raises InputError as the tracers do."""
    check_range(mesh, camera)
    pool, lanes = WorkerPool(1), native_lanes()
    compile_kernels(lanes, camera.is_parallel)
    scratch = Scratch.of(mesh, pool)
    images = outputs((camera.height, camera.width), camera.width, None)
    frames_s = []
    for _ in range(2):  # the first finds caches cold
        start = thread_time()
        draw_frame(mesh, camera, (0.5, 0.5), lanes, scratch, pool, images)
        frames_s.append(thread_time() - start)
    widest = native_packet_widths()[-1]
    shapes = ((1, 1), *((widest >> k, 1 << k) for k in range(widest.bit_length())))
    kept = np.ones(mesh.triangle_count, np.bool_)
    kept[unseen_from(camera, mesh)] = False
    order = scratch.clusters.prim_ids.astype(np.int64)
    order = order[kept[order]]
    corners, depths = _sampled_pixels(camera, images[0])
    counted = _count(mesh, camera, order, corners, depths, shapes, pool)
    in_view = min(len(scratch.order()) * 128, mesh.triangle_count)
    is_seen = np.zeros(mesh.triangle_count + 1, np.bool_)
    is_seen[np.minimum(images[1], mesh.triangle_count)] = True  # the last one is a miss
    samples = (Sample.of(mesh, order, camera, pool), Sample.of(mesh, np.flatnonzero(is_seen[:-1]), camera, pool))
    pool.close()
    return Look(
        camera.width, camera.height, mesh.triangle_count, in_view, camera.is_parallel, shapes, *counted,
        float(np.isfinite(images[0]).mean()), _edges(images[0]), min(frames_s), scratch.bytes, samples,
    )  # fmt: skip


def apart(mesh: Mesh, prim_ids: NDArray[np.integer]) -> Mesh:
    """A mesh of the triangles named, each with corners of its own."""
    vertices = mesh.vertices[mesh.faces[prim_ids]].reshape(-1, 3)
    return Mesh(vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3))


def _spread(order: NDArray[np.integer], most: int) -> NDArray[np.integer]:
    """At most so many of an array, evenly spread along it."""
    if len(order) <= most:
        return order
    return order[np.linspace(0, len(order), most, endpoint=False).astype(np.int64)]


def _sampled_pixels(camera: View, depth: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Upper left pixels of blocks, (B, 2), one in each stratum of the image, and (B, RAYS), what their rays see."""
    random = np.random.default_rng(1)
    size = np.array([camera.width, camera.height])
    places = np.stack(np.meshgrid(np.arange(STRATA), np.arange(STRATA)), axis=-1).reshape(-1, 2)
    corners = ((places + random.random(places.shape)) / STRATA * np.maximum(size - SIDE + 1, 1)).astype(np.int64)
    x, y = (corners[:, axis, None] + np.arange(SIDE) for axis in (0, 1))
    inside = (x < camera.width)[:, None, :] & (y < camera.height)[:, :, None]
    seen = depth[np.minimum(y, camera.height - 1)[:, :, None], np.minimum(x, camera.width - 1)[:, None, :]]
    return corners, np.where(inside, seen, np.float32(np.inf)).reshape(-1, RAYS)


def _count(
    mesh: Mesh, camera: View, order: NDArray[np.int64], corners: NDArray[np.int64], depths: NDArray[np.float32],
    shapes: tuple[tuple[int, int], ...], pool: WorkerPool,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """boxes, tested and met of `Look`."""
    boxes, tested, met = np.zeros((len(shapes), 2, LEVELS), np.int64), *np.zeros((2, len(shapes), 2), np.int64)
    packets = len(corners) * RAYS / np.prod(shapes, axis=1)
    if len(order):
        few = _spread(order, MOST_IN_TREE)
        is_whole = len(few) == len(order)
        sample = mesh if is_whole else apart(mesh, few)
        _, points = project_vertices(sample, camera, pool)
        vertices, faces = points.astype(np.float32), mesh.faces[few] if is_whole else sample.faces
        bounds = np.empty((len(faces), 6), np.float32)
        pool.run(lambda _, counter: bound_triangles(counter, vertices, faces, bounds))
        count = len(faces)
        draft = Draft(
            np.empty((2 * count, 6), np.float32), np.empty((2 * count, 3), np.int32), bounds,
            np.arange(count, dtype=np.int32),
        )  # fmt: skip
        rays = _rays(camera, corners)
        ways = rays.copy()
        size = np.maximum(np.abs(rays[:, 3:]), SMALLEST_COMPONENT)
        ways[:, 3:] = np.copysign(np.float32(1.0) / size, rays[:, 3:])
        count_along_rays(vertices, faces, draft, rays, ways, depths, np.array(shapes), boxes, tested, met)
        return _whole(len(order) / count, boxes / packets[:, None, None], tested / packets[:, None],
                      met / packets[:, None], count)  # fmt: skip
    return boxes.astype(np.float64), tested.astype(np.float64), met.astype(np.float64)


def _rays(camera: View, corners: NDArray[np.int64]) -> NDArray[np.float32]:
    """(B, 6, RAYS) float32: origins and directions of blocks of rays in ray space."""
    rays = np.zeros((len(corners), 6, SIDE, SIDE), np.float32)
    first = 0 if camera.is_parallel else 3
    x, y = ((corners[:, axis, None] + np.arange(SIDE)).ravel() for axis in (0, 1))
    across, down = ray_grid(camera, camera.plane.columns(x, 0.5), camera.plane.rows(y, 0.5))
    across, down = (one.reshape(3, len(corners), SIDE).transpose(1, 0, 2) for one in (across, down))
    rays[:, first : first + 3] = across[:, :, None, :] + down[:, :, :, None]
    if camera.is_parallel:
        rays[:, 3:] = np.asarray(camera.axes[2], np.float32)[:, None, None]
    return rays.reshape(len(corners), 6, RAYS)


def _whole(
    times: float, boxes: NDArray[np.float64], tested: NDArray[np.float64], met: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What a tree of all triangles would have, `times` as many as were in the tree of `count`: levels between its upper
    ones and its leaves, to which boxes grow as they did before."""
    if times <= 1.0:
        return boxes, tested, met
    extra, last = round(np.log2(times)), max(int(np.log2(count)) - 3, 1)
    growth = np.clip(boxes[..., last] / np.maximum(boxes[..., last - 1], 1e-9), 0.5, 2.0)
    whole = np.zeros_like(boxes)
    whole[..., : last + 1] = boxes[..., : last + 1]
    for step in range(1, extra + 1):
        whole[..., last + step] = boxes[..., last] * growth**step
    tail = boxes[..., last + 1 : LEVELS - extra]
    whole[..., last + 1 + extra :] = tail * (growth**extra)[..., None]
    return whole, tested * growth**extra, met * times


def _edges(depth: NDArray[np.float32]) -> float:
    """The share of tiles of 4 x 4 pixels across which depth jumps, or of which only a part hits anything."""
    height, width = (pixels - pixels % 4 for pixels in depth.shape)
    if not (height and width):
        return 0.0
    rows = depth[:height, :width].reshape(height // 4, 4, width)  # rows first, as these are contiguous
    low, high = rows.min(axis=1), rows.max(axis=1)
    near = np.minimum.reduce([low[:, k::4] for k in range(4)])
    far = np.maximum.reduce([high[:, k::4] for k in range(4)])
    with np.errstate(invalid="ignore"):
        return float(np.mean((far > near * (1 + BROKEN)) & np.isfinite(near)))
