"""A frame of all hits: clusters culled, bands gone over."""

from __future__ import annotations

from typing import Any

from atra.all_hits.taking_kernels import LAYERS
from atra.all_hits.target_kernels import Target
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.all_hits.drawing_kernels import SPARE, gathering_kernel
from atra.raster.frames import FrameMemory
from atra.raster.image import eye_of

_BAND_BYTES, _LEAST_ROWS, _MOST_ROWS = 5 << 18, 16, 256
"""Bytes of a band, which stay in the cache while it is drawn; its least and most rows, powers of two."""

_BANDS = 4
"""Smallest number of bands per thread; with fewer, threads wait long for the last one."""


def gather_frame(
    mesh: Mesh,
    camera: View,
    offset: tuple[float, float],
    lanes: int,
    memory: FrameMemory,
    pool: WorkerPool,
    kind: int,
    target: Target,
) -> None:
    """Take all hits of all pixels. kind: of `taking_kernels`. target: its image is written completely."""
    width, height = camera.width, camera.height
    drawn = target.layers + 1 if kind == LAYERS else 1  # numbers of a pixel, if half of its layers hold a hit
    row_bytes = drawn * target.row * 4
    band_rows = _MOST_ROWS
    while band_rows > _LEAST_ROWS and (
        band_rows * row_bytes > _BAND_BYTES or band_rows * _BANDS * pool.threads > height
    ):
        band_rows //= 2
    eye, _numbers = eye_of(mesh, camera, offset)
    memory.cull(eye, camera, band_rows, pool)
    order = memory.order()  # what is near first leaves little to be sorted
    numbers = 2 * (target.layers + SPARE) + 1 if kind == LAYERS else 1
    threads = memory.of_threads(pool.threads, width, band_rows, band_rows * numbers * target.row * 4)
    gather_bands: Any = gathering_kernel(lanes, camera.is_parallel, kind)
    rest, block = (eye, memory.clusters.addresses, memory.rectangles, order, band_rows, width, height), target.block()
    pool.run(lambda worker, counter: gather_bands(counter, *rest, threads[worker], block.ctypes.data))
