"""All crossings of an image, found by testing every triangle: slow, exact, and the rule that every method keeps."""

from __future__ import annotations

import numpy as np

from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import SUMMANDS
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.raster.all_hits.crossings_kernels import projected
from tests.all_hits.crossings_kernels import list_crossings
from tests.all_hits.plain import Crossings


def all_crossings(mesh: Mesh, camera: View, offset: tuple[float, float] = (0.5, 0.5)) -> Crossings:
    """All crossings of an image, by the rule of `atra.all_hits.reductions`.

    Takes some nanoseconds for each triangle and each pixel of its box. Raises InputError for a bad offset.
    """
    check_offset(offset)
    pool = WorkerPool(1)
    view, points = projected(mesh, camera, offset, pool)
    exact = np.empty(SUMMANDS)
    room = 4 * camera.width * camera.height
    while True:
        pixels, prim_ids, depths = np.empty(room, np.int64), np.empty(room, np.uint32), np.empty(room)
        facings = np.empty(room, np.int8)
        size = camera.width, camera.height
        out = pixels, prim_ids, facings, depths
        count = list_crossings(camera.is_parallel, view, points, mesh.faces, *size, exact.ctypes.data, *out)
        if count <= room:
            break
        room = count
    order = np.lexsort((prim_ids[:count], depths[:count], pixels[:count]))
    return Crossings(pixels[order], prim_ids[order], depths[order], facings[order] > 0, mesh, camera, offset)
