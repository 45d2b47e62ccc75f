"""Doubts of a view: which samples are too near an edge for float32 rays, decided exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import SUMMANDS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.raster.all_hits.crossings_kernels import projected
from atra.raster.all_hits.doubts_kernels import Precision, decide, face, list_doubts, mark
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.gathering import ROOM

_ROOM = 1 << 20
"""Samples in doubt that memory is made for at first."""


@dataclass(frozen=True, eq=False)
class Doubts:
    """keys: (N,) int64, (y * width + x) << 32 | triangle, ascending; facings, depths: (N,) float32 of `decide`.
    lists: marks, first and listed of `Target`. faces: (F,) float32, of each triangle as `facing_of` has it.
    """

    keys: NDArray[np.int64]
    facings: NDArray[np.float32]
    depths: NDArray[np.float32]
    lists: tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.uint32]]
    faces: NDArray[np.float32]


def find_doubts(
    mesh: Mesh, camera: View, offset: tuple[float, float], precision: Precision, row: int, pool: WorkerPool
) -> Doubts:
    """row: pixels from one row of the images that are gathered into to the next.

    Raises MemoryBudgetError for more samples in doubt than the free memory holds.
    """
    view, points = projected(mesh, camera, offset, pool)
    parallel, width, height = camera.is_parallel, camera.width, camera.height
    room = _ROOM
    while True:
        found, size = np.empty(room, np.int64), np.zeros(1, np.int64)
        rest = parallel, view, points, mesh.faces, width, height, precision, found, size.ctypes.data
        pool.run(lambda _, counter, rest=rest: list_doubts(counter, *rest))  # type: ignore[misc]
        if size[0] <= room:
            break
        room = int(size[0])
        what = f"{room:,} samples so near an edge that float32 cannot decide about them"
        check_needed_bytes(3 * 8 * room, None, what, "use RasterTracer, or fewer pixels")
    keys = np.sort(found[: size[0]])
    keys = keys[np.diff(keys, prepend=-1) > 0]  # `np.unique` hashes, and takes a hundred times as long
    exact = np.empty((pool.threads, 2 * SUMMANDS))
    facings, depths = np.empty(len(keys), np.float32), np.empty(len(keys), np.float32)
    decide(parallel, view, points, mesh.faces, width, keys, exact.ctypes.data, facings, depths)
    shape = (height + ROOM, row)
    lists = np.zeros(shape, np.uint8), np.empty(shape, np.int32), np.empty(2 * len(keys) + 1, np.uint32)
    mark(keys, width, *lists)
    faces = np.empty(mesh.triangle_count, np.float32)
    pool.run(
        lambda worker, counter: face(counter, parallel, view, points, mesh.faces, exact[worker].ctypes.data, faces)
    )
    return Doubts(keys, facings, depths, lists, faces)
