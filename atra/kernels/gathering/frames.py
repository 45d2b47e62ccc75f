"""A frame of all hits: vertices projected, triangles listed, bands gone over; and the memory that frames share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.kernels.gathering.crossings import projected
from atra.kernels.gathering.drawing import gathering_kernel
from atra.kernels.gathering.listing import CHUNK, fill_bands, list_triangles, place_bands
from atra.kernels.gathering.target import Target
from atra.kernels.raster.exact import SUMMANDS
from atra.kernels.raster.spans import ROWS
from atra.parallel import WorkerPool

_BAND_BYTES, _LEAST_ROWS, BAND_ROWS = 1 << 19, 4, 32
"""Bytes of a band, which stay in the cache while it is drawn; its least and most rows, powers of two."""


class Workspace(NamedTuple):
    """Addresses of memory of one thread, as of `atra.kernels.raster.image.Workspace`."""

    exact: int
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Scratch:
    """Memory of the frames of one mesh. points: (V, 4) float64. listed: (F,) uint32, bands: (F, 2) int32. exact,
    first, last: (threads, ...) float64, as `Workspace` has them."""

    points: NDArray[np.float64]
    listed: NDArray[np.uint32]
    bands: NDArray[np.int32]
    rows: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Mesh, threads: int) -> Scratch:
        triangles = mesh.triangle_count
        return cls(
            np.empty((len(mesh.vertices), 4)),
            np.empty(triangles, np.uint32),
            np.empty((triangles, 2), np.int32),
            np.empty((threads, 2 * (BAND_ROWS + ROWS) + SUMMANDS + 2 * ROWS)),
        )

    def workspace(self, thread: int) -> Workspace:
        first, last, exact = np.split(self.rows[thread], (BAND_ROWS + ROWS, 2 * (BAND_ROWS + ROWS)))
        return Workspace(exact.ctypes.data, first.ctypes.data, last.ctypes.data)


def gather_frame(
    mesh: Mesh,
    camera: View,
    offset: tuple[float, float],
    lanes: int,
    scratch: Scratch,
    pool: WorkerPool,
    kind: int,
    target: Target,
) -> None:
    """Take all hits of all pixels. kind: of `taking`. target: its image is written completely."""
    width, height, parallel = camera.width, camera.height, camera.is_parallel
    points, faces = scratch.points, mesh.faces
    view = projected(mesh, camera, offset, pool, points)
    band_rows, row_bytes = BAND_ROWS, target.layers * target.row * 4
    while band_rows > _LEAST_ROWS and band_rows * row_bytes > _BAND_BYTES:
        band_rows //= 2
    counts = np.empty((-(-len(faces) // CHUNK), -(-height // band_rows) + 1), np.int64)
    starts = np.empty(counts.shape[1], np.int64)
    lists = scratch.listed, scratch.bands, counts
    pool.run(lambda _, counter: list_triangles(counter, points, faces, parallel, width, height, band_rows, *lists))
    place_bands(counts, starts)
    entries = np.empty(int(starts[-1]), np.uint32)
    pool.run(lambda _, counter: fill_bands(counter, *lists, entries))
    gather_bands: Any = gathering_kernel(lanes, parallel, kind)
    block = target.block()
    address = block.ctypes.data

    def gather(worker: int, counter: int) -> None:
        workspace = scratch.workspace(worker)
        gather_bands(counter, view, points, faces, starts, entries, band_rows, width, height, workspace, address)

    pool.run(gather)
