"""One cheap look at a mesh and a view: a raster frame, boxes along sampled rays, copies of sampled triangles."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import thread_time

import numpy as np
from numpy.typing import NDArray

from atra.compiled.instruction_sets import native_lanes
from atra.compiled.threads import WorkerPool
from atra.embree.library import load_library
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_mesh
from atra.geometry.ray_space import check_range, own_space, unseen_from
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.raster.frames import FrameMemory, draw_frame
from atra.tracing.images import outputs
from atra.tracing.rays import ray_grid
from atra.trees.building import Draft, bound_triangles
from experiments.law.model.copying import Copied, Sample, apart, bytes_of_clusters, spread
from experiments.law.model.counting_kernels import RAYS, SIDE
from experiments.law.model.looking_kernels import LEVELS, count_along_rays

STRATA = 8
"""Blocks of sampled rays along each side of the image."""

MOST_IN_TREE = 1 << 18
"""Largest sample of triangles for the tree."""

SMALLEST_COMPONENT = np.float32(1e-18)
"""Smaller components of directions count as this, as 0 has no reciprocal."""


@dataclass(frozen=True, eq=False)
class Look:
    """Measures of a mesh and a view that the cost model predicts from.

    width, height: of the image, pixels. triangles, vertices: of the mesh.
    shapes: (columns, rows) of packets. boxes: (shapes, 2, LEVELS) float64, boxes of each level of a binary SAH tree
    that a packet of that shape enters, on average over the sample: along the whole ray, and up to what it sees. tested:
    (shapes, 2), triangles in the leaves entered. met: (shapes, 2), triangles that a packet hits. hit: share of rays
    that hit anything. raster_s: processor seconds of the raster frame on one thread. raster_bytes: of its clusters.
    bvh_bytes: of our own BVH, by that of some clusters. sample: of triangles that rays may hit. counted: what was
    `copied` already.
    """

    width: int
    height: int
    triangles: int
    vertices: int
    is_parallel: bool
    shapes: tuple[tuple[int, int], ...]
    boxes: NDArray[np.float64]
    tested: NDArray[np.float64]
    met: NDArray[np.float64]
    hit: float
    raster_s: float
    raster_bytes: int
    bvh_bytes: float
    sample: Sample = field(repr=False)
    counted: dict[tuple[str, tuple[int, int], bool], Copied] = field(default_factory=dict, repr=False)

    def copied(self, method: str, split: tuple[int, int], culling: bool = True) -> Copied:
        """What a method of `choice.METHODS` copies, leaves out and traces again, estimated from a sample."""
        key = method, split, culling
        if key not in self.counted:
            self.counted[key] = self._count(method, Split(*split, self.width, self.height), culling)
        return self.counted[key]

    def _count(self, method: str, cells: Split, culling: bool) -> Copied:
        if method == "tiles":
            return self.sample.in_cells(cells)
        if method == "visible_first":
            return self.sample.visible(cells)
        if method == "aligned":
            return self.sample.aligned(cells, culling)
        if method == "instanced":
            return self.sample.aligned(cells, False, True)._replace(copies=0.0)
        return Copied(0.0, 0.0, 0.0)

    def shape(self, shape: tuple[int, int]) -> int:
        """The place of a shape in `shapes`."""
        return self.shapes.index(shape)


def look_at(mesh: Mesh, camera: View) -> Look:
    """Look at a mesh from a camera, on one thread. Raises InputError as the tracers do."""
    check_range(mesh, camera)
    mesh, camera = own_space(mesh, camera)
    pool, lanes = WorkerPool(1), native_lanes()
    memory = FrameMemory.of(mesh, pool)
    images = outputs((camera.height, camera.width), camera.width, None)
    frames_s = []
    for _ in range(2):  # the first finds caches cold, and may compile
        start = thread_time()
        draw_frame(mesh, camera, (0.5, 0.5), lanes, memory, pool, images)
        frames_s.append(thread_time() - start)
    widest = load_library().native_packet_widths[-1]
    shapes = ((1, 1), *((widest >> k, 1 << k) for k in range(widest.bit_length())))
    kept = np.ones(mesh.triangle_count, np.bool_)
    kept[unseen_from(camera, mesh)] = False
    order = memory.clusters.prim_ids.astype(np.int64)
    order = order[kept[order]]
    corners, depths = _sampled_pixels(camera, images[0])
    counted = _count(mesh, camera, order, corners, depths, shapes, pool)
    bvh_bytes = bytes_of_clusters(mesh, memory.clusters.prim_ids, pool)
    sample = Sample.of(mesh, order, camera, images[0], pool)
    pool.close()
    return Look(
        camera.width, camera.height, mesh.triangle_count, len(mesh.vertices), camera.is_parallel, shapes, *counted,
        float(np.isfinite(images[0]).mean()), min(frames_s), memory.bytes, bvh_bytes, sample,
    )  # fmt: skip


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
    """boxes, tested and met of `Look`. order: (N,), triangles, neighbours together. corners, depths: of blocks of rays,
    as from `_sampled_pixels`."""
    boxes, tested, met = np.zeros((len(shapes), 2, LEVELS), np.int64), *np.zeros((2, len(shapes), 2), np.int64)
    if not len(order):
        return boxes.astype(np.float64), tested.astype(np.float64), met.astype(np.float64)
    few, rays = spread(order, MOST_IN_TREE), _rays(camera, corners)
    is_whole = len(few) == len(order)
    sample = mesh if is_whole else apart(mesh, few)
    vertices = project_mesh(sample, camera, pool)[1].astype(np.float32)
    faces, count = mesh.faces[few] if is_whole else sample.faces, len(few)
    bounds = np.empty((count, 6), np.float32)
    pool.run(lambda _, counter: bound_triangles(counter, vertices, faces, bounds))
    draft = Draft(
        np.empty((2 * count, 6), np.float32), np.empty((2 * count, 3), np.int32), bounds,
        np.arange(count, dtype=np.int32),
    )  # fmt: skip
    ways = rays.copy()
    size = np.maximum(np.abs(rays[:, 3:]), SMALLEST_COMPONENT)
    ways[:, 3:] = np.copysign(np.float32(1.0) / size, rays[:, 3:])
    count_along_rays(vertices, faces, draft, rays, ways, depths, np.array(shapes), boxes, tested, met)
    packets = len(rays) * RAYS / np.prod(shapes, axis=1)
    return _whole(
        len(order) / count, boxes / packets[:, None, None], tested / packets[:, None], met / packets[:, None], count
    )


def _rays(camera: View, corners: NDArray[np.int64]) -> NDArray[np.float32]:
    """(B, 6, RAYS) float32: origins and directions of blocks of rays in ray space."""
    rays = np.zeros((len(corners), 6, SIDE, SIDE), np.float32)
    first = 0 if camera.is_parallel else 3
    x, y = ((corners[:, axis, None] + np.arange(SIDE)).ravel() for axis in (0, 1))
    across, down = ray_grid(camera, camera.plane.columns(x, 0.5), camera.plane.rows(y, 0.5))
    across, down = (plane.reshape(3, len(corners), SIDE).transpose(1, 0, 2) for plane in (across, down))
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
