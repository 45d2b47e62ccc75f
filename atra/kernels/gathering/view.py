"""The view that is gathered from: the vertices of a mesh in its pixels, as the rasteriser has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.kernels.raster.image import ViewOfMesh
from atra.kernels.raster.listing import project
from atra.parallel import WorkerPool

_LEAST_DEPTH = 1e-25
"""As in `atra.kernels.raster.frames`."""


def projected(
    mesh: Mesh, camera: View, offset: tuple[float, float], pool: WorkerPool, points: NDArray[np.float64]
) -> ViewOfMesh:
    """The view with the samples of `offset` at whole numbers; points: (V, 4) float64, written as `project` does."""
    to_pixels = camera.to_pixels.copy()
    to_pixels[:2] -= np.outer(offset, to_pixels[2])
    eye = np.array(camera.eye)
    least_depth = 0.0 if camera.is_parallel else _LEAST_DEPTH * float(np.abs(mesh.bounds - eye).max())
    pool.run(lambda _, counter: project(counter, mesh.vertices, eye, to_pixels, camera.axes[2], least_depth, points))
    return ViewOfMesh(mesh.vertices, eye, to_pixels)
