"""A frame: clusters culled, bands drawn; and the memory that frames share."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.target_kernels import band_stride
from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import SUMMANDS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.clusters import CLUSTER, POINT_BYTES, VERTICES, Clusters, clusters_of
from atra.raster.culling import TILE, cull_clusters, tile_stride
from atra.raster.drawing import drawing_kernel
from atra.raster.image import CACHE_LINE, Eye, Image, Viewpoint, Workspace
from atra.raster.spans import ROWS
from atra.raster.triangles import BATCH, DOUBLES, FLOATS, LIST_ROOM

_BAND_PIXELS, _BAND_ROWS = 1 << 16, (16, 64)
"""Pixels of a band, half a megabyte of image; and its least and most rows. The first bands have twice as many rows, as
each triangle is then in fewer of them; small ones come last, so that no thread waits long for another."""

_DOUBLED = 3 / 8
"""Share of an image's rows, in bands, that are drawn twice at a time."""

_CLUSTERS_A_THREAD = 4096
"""Fewer are culled in less time than it takes to wake another thread."""


@dataclass(frozen=True, eq=False)
class Scratch:
    """A mesh in clusters, and memory of its frames. rectangles, bounds: of `cull_clusters`. parts: of the memory of
    `workspaces`, by what they were asked for."""

    clusters: Clusters
    rectangles: NDArray[np.int32]
    bounds: NDArray[np.float32]
    workspaces: list[NDArray[np.uint8]] = field(default_factory=list)
    parts: dict[tuple[int, ...], list[Workspace]] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: Mesh, pool: WorkerPool) -> Scratch:
        """Make the clusters of a mesh."""
        clusters = clusters_of(mesh, pool)
        return cls(clusters, np.empty((clusters.count, 4), np.int32), np.empty(clusters.count, np.float32))

    @property
    def bytes(self) -> int:
        """Memory of all arrays."""
        own = self.rectangles.nbytes + self.bounds.nbytes + sum(memory.nbytes for memory in self.workspaces)
        return self.clusters.bytes + own

    def workspaces_for(self, threads: int, width: int, band_rows: int, band_bytes: int) -> list[Workspace]:
        """One for each thread; band_bytes: of its image of a band."""
        key = threads, width, band_rows, band_bytes
        if key in self.parts:
            return self.parts[key]
        sizes = (
            band_bytes,
            8 * SUMMANDS,
            8 * (band_rows + ROWS),
            8 * (band_rows + ROWS),
            (3 * CLUSTER + VERTICES) * POINT_BYTES,
            8 * LIST_ROOM,
            8 * BATCH * DOUBLES,
            4 * BATCH * FLOATS,
            4 * -(-band_rows // TILE) * tile_stride.py_func(width),
            8 * (self.clusters.count + 1),
        )
        parts = [-(-part // CACHE_LINE) * CACHE_LINE for part in sizes]
        wanted = sum(parts) + CACHE_LINE
        if len(self.workspaces) != threads or len(self.workspaces[0]) < wanted:
            self.workspaces[:] = [np.empty(wanted, np.uint8) for _ in range(threads)]
            self.parts.clear()
        made = []
        for memory in self.workspaces:
            start = -(-memory.ctypes.data // CACHE_LINE) * CACHE_LINE
            made.append(Workspace(*accumulate((start, *parts[:-1]))))
        self.parts[key] = made
        return made

    def cull(self, eye: Eye, camera: View, band_rows: int, pool: WorkerPool) -> None:
        """Find rectangles and bounds for a frame."""
        rest = self.clusters.boxes, eye, camera.is_parallel, camera.width, camera.height, band_rows
        threads = 1 + self.clusters.count // _CLUSTERS_A_THREAD
        pool.run(lambda _, counter: cull_clusters(counter, *rest, self.rectangles, self.bounds), threads)

    def order(self) -> NDArray[np.int64]:
        """The clusters that may be seen, the nearest first."""
        may_be_seen = np.flatnonzero(self.rectangles[:, 2] <= self.rectangles[:, 3])
        return may_be_seen[np.argsort(-self.bounds[may_be_seen])]


def bands_of(width: int, height: int) -> tuple[int, int]:
    """Rows of a band of an image, a power of two; and how many bands have twice as many."""
    least_rows, most_rows = _BAND_ROWS
    rows = min(max(1 << (_BAND_PIXELS // width).bit_length() >> 1, least_rows), most_rows)
    return rows, int(_DOUBLED * (height // rows))


def draw_frame(
    mesh: Mesh,
    camera: View,
    offset: tuple[float, float],
    lanes: int,
    scratch: Scratch,
    pool: WorkerPool,
    out: tuple[NDArray[np.float32], NDArray[np.uint32]],
) -> None:
    """Write depth and prim_id of all pixels to `out`, two arrays (H, W)."""
    depth, prim_id = out
    width, height, parallel = camera.width, camera.height, camera.is_parallel
    viewpoint = Viewpoint.of(mesh, camera, offset)
    band_rows, doubled = bands_of(width, height)
    image = Image(depth.ctypes.data, prim_id.ctypes.data, width, height)
    eye, addresses = viewpoint.eye, scratch.clusters.addresses
    rectangles, bounds = scratch.rectangles, scratch.bounds
    draw_bands: Any = drawing_kernel(lanes, parallel)
    scratch.cull(eye, camera, band_rows, pool)
    order = scratch.order()
    most_rows = 2 * band_rows if doubled else band_rows
    workspaces = scratch.workspaces_for(pool.threads, width, most_rows, 8 * most_rows * band_stride.py_func(width))

    def draw(worker: int, counter: int) -> None:
        draw_bands(counter, eye, addresses, rectangles, bounds, order, band_rows, doubled, image, workspaces[worker])

    pool.run(draw)
