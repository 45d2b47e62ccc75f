"""Undecided samples of a view: those too near an edge for float32 rays, decided exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import SUMMANDS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.all_hits.crossings_kernels import projected
from atra.raster.all_hits.undecided_kernels import Precision, decide, list_undecided, mark
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.gathering import ROOM

_FIRST_ROOM = 1 << 20
"""Undecided samples that memory is made for at first."""


@dataclass(frozen=True, eq=False)
class UndecidedHits:
    """keys: (N,) int64, (y * width + x) << 32 | triangle, ascending; facings, depths: (N,) float32 of `decide`.
    lists: marks, first and listed of `Target`. faces: (F,) float32, of each triangle as `facing_of` has it.
    """

    keys: NDArray[np.int64]
    facings: NDArray[np.float32]
    depths: NDArray[np.float32]
    lists: tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.uint32]]
    faces: NDArray[np.float32]


def decide_hits(
    mesh: Mesh, camera: View, offset: tuple[float, float], precision: Precision, row: int, pool: WorkerPool
) -> UndecidedHits:
    """Find the undecided samples of a view, and decide them. row: pixels from row to row of the gathered images.

    Raises MemoryBudgetError for more undecided samples than the free memory holds.
    """
    view, points = projected(mesh, camera, offset, pool)
    parallel, width, height = camera.is_parallel, camera.width, camera.height
    room, faces, exact = _FIRST_ROOM, np.empty(mesh.triangle_count, np.float32), np.empty((pool.threads, 2 * SUMMANDS))
    inputs = parallel, view, points, mesh.faces, width, height, precision
    while True:
        found, size = np.empty(room, np.int64), np.zeros(1, np.int64)

        def work(worker: int, counter: int, found: NDArray = found, size: NDArray = size) -> None:
            list_undecided(counter, *inputs, exact[worker].ctypes.data, found, size.ctypes.data, faces)

        pool.run(work)
        if size[0] <= room:
            break
        room = int(size[0])
        what = f"{room:,} samples so near an edge that float32 cannot decide about them"
        check_needed_bytes(3 * 8 * room, None, what, "use RasterTracer, or fewer pixels")
    keys = np.sort(found[: size[0]])
    keys = keys[np.diff(keys, prepend=-1) > 0]  # `np.unique` hashes, and takes a hundred times as long
    facings, depths = np.empty(len(keys), np.float32), np.empty(len(keys), np.float32)
    decide(parallel, view, points, mesh.faces, faces, width, keys, exact.ctypes.data, facings, depths)
    shape = (height + ROOM, row)
    lists = np.zeros(shape, np.uint8), np.empty(shape, np.int32), np.empty(2 * len(keys) + 1, np.uint32)
    mark(keys, width, *lists)
    return UndecidedHits(keys, facings, depths, lists, faces)
