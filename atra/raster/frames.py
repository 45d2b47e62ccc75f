"""A frame: clusters culled, bands drawn; and the memory that frames share."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.target_kernels import band_stride
from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import SUMMANDS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.clusters import CLUSTER, POINT_BYTES, VERTICES, Clusters, clusters_of
from atra.raster.culling import TILE, cull_clusters, tile_stride
from atra.raster.drawing import drawing_kernel
from atra.raster.image import CACHE_LINE, Eye, ImageAddresses, ThreadMemory, eye_of
from atra.raster.set_up import DOUBLES, FLOATS
from atra.raster.spans import ROWS
from atra.raster.triangles import BATCH, LIST_ROOM

_BAND_PIXELS, _BAND_ROWS = 1 << 16, (16, 64)
"""Pixels of a band, half a megabyte of image; and its least and most rows. The first bands have twice as many rows, as
each triangle is then in fewer of them; small ones come last, so that no thread waits long for another."""

_DOUBLED = 3 / 8
"""Share of an image's rows, in bands, that are drawn twice at a time."""

_CLUSTERS_A_THREAD = 4096
"""Fewer are culled in less time than it takes to wake another thread."""


@dataclass(frozen=True, eq=False)
class FrameMemory:
    """A mesh in clusters, and memory that its frames share. rectangles, bounds: of `cull_clusters`. blocks: of each
    thread, reused; parts: addresses of their parts, by what was asked for."""

    clusters: Clusters
    rectangles: NDArray[np.int32]
    bounds: NDArray[np.float32]
    blocks: list[NDArray[np.uint8]] = field(default_factory=list)
    parts: dict[tuple[int, ...], list[ThreadMemory]] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: Mesh, pool: WorkerPool) -> FrameMemory:
        """Make the clusters of a mesh."""
        clusters = clusters_of(mesh, pool)
        return cls(clusters, np.empty((clusters.count, 4), np.int32), np.empty(clusters.count, np.float32))

    @property
    def bytes(self) -> int:
        """Memory of all arrays."""
        own = self.rectangles.nbytes + self.bounds.nbytes + sum(block.nbytes for block in self.blocks)
        return self.clusters.bytes + own

    def of_threads(self, threads: int, width: int, band_rows: int, band_bytes: int) -> list[ThreadMemory]:
        """Memory for each thread; band_bytes: of its image of a band."""
        key = threads, width, band_rows, band_bytes
        if key in self.parts:
            return self.parts[key]
        sizes = ThreadMemory(
            band=band_bytes,
            exact=8 * SUMMANDS,
            first=8 * (band_rows + ROWS),
            last=8 * (band_rows + ROWS),
            points=(3 * CLUSTER + VERTICES) * POINT_BYTES,
            listed=8 * LIST_ROOM,
            doubles=8 * BATCH * DOUBLES,
            floats=4 * BATCH * FLOATS,
            tiles=4 * -(-band_rows // TILE) * tile_stride.py_func(width),
            here=8 * (self.clusters.count + 1),
        )
        starts = list(accumulate((-(-size // CACHE_LINE) * CACHE_LINE for size in sizes), initial=0))
        if len(self.blocks) != threads or len(self.blocks[0]) < starts[-1]:
            self.blocks[:] = [aligned_empty((starts[-1],), np.uint8) for _ in range(threads)]
            self.parts.clear()
        made = [ThreadMemory(*(block.ctypes.data + start for start in starts[:-1])) for block in self.blocks]
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
    memory: FrameMemory,
    pool: WorkerPool,
    out: tuple[NDArray[np.float32], NDArray[np.uint32]],
) -> None:
    """Write depth and prim_id of all pixels to `out`, two arrays (H, W)."""
    depth, prim_id = out
    width, height, clusters = camera.width, camera.height, memory.clusters.addresses
    eye, _numbers = eye_of(mesh, camera, offset)
    band_rows, doubled = bands_of(width, height)
    image = ImageAddresses(depth.ctypes.data, prim_id.ctypes.data, width, height)
    draw_bands: Any = drawing_kernel(lanes, camera.is_parallel)
    memory.cull(eye, camera, band_rows, pool)
    culled = memory.rectangles, memory.bounds, memory.order(), band_rows, doubled
    most_rows = 2 * band_rows if doubled else band_rows
    threads = memory.of_threads(pool.threads, width, most_rows, 8 * most_rows * band_stride.py_func(width))
    pool.run(lambda worker, counter: draw_bands(counter, eye, clusters, *culled, image, threads[worker]))
