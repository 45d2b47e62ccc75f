"""Reductions by plain NumPy on a list of all crossings: slow, the reference that kernels are compared with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Count, Gathered, Layers, Reduction, Thickness, Transmittance
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS


@dataclass(frozen=True, eq=False)
class Crossings:
    """Every triangle that a pixel's ray crosses, sorted by pixel, depth and prim_id.

    pixels: (N,) int64, y * width + x. prim_ids: (N,) uint32. depths: (N,) float64, scene units along the view axis.
    leaving: (N,) bool, the ray leaves a closed mesh there. mesh, camera, offset: what was traced.
    """

    pixels: NDArray[np.int64]
    prim_ids: NDArray[np.uint32]
    depths: NDArray[np.float64]
    leaving: NDArray[np.bool_]
    mesh: Mesh
    camera: View
    offset: tuple[float, float]


def gather_plainly(found: Crossings, what: Reduction[Gathered]) -> Gathered:
    """Reduce the crossings of each pixel by `what`. Raises InputError as a tracer's `gather` does."""
    mesh, camera = found.mesh, found.camera
    arrays = _reduced(what, what.weights(mesh), found, camera.width * camera.height)
    shape = (camera.height, camera.width)
    shaped = {name: array.reshape(array.shape[:-1] + shape) for name, array in arrays.items()}
    return what.result(**shaped, offset=found.offset, mesh=mesh, camera=camera)


def _reduced(
    what: Reduction[Gathered], weights: NDArray[np.float32] | None, found: Crossings, size: int
) -> dict[str, NDArray]:
    """The arrays of a result, (..., size)."""
    match what:
        case Count():
            return {"count": np.bincount(found.pixels, minlength=size).astype(np.uint32)}
        case Thickness():
            signed = np.where(found.leaving, found.depths, -found.depths)
            return {"thickness": np.bincount(found.pixels, signed, size).astype(np.float32)}
        case Transmittance():
            assert weights is not None
            product = np.ones(size)
            np.multiply.at(product, found.pixels, weights[found.prim_ids])
            return {"transmittance": product.astype(np.float32)}
        case Layers():
            count = np.bincount(found.pixels, minlength=size)
            place = np.arange(len(found.pixels)) - np.repeat(np.cumsum(count) - count, count)
            kept = place < what.k
            depth, prim_id = np.full((what.k, size), np.inf, np.float32), np.full((what.k, size), MISS)
            depth[place[kept], found.pixels[kept]] = found.depths[kept]
            prim_id[place[kept], found.pixels[kept]] = found.prim_ids[kept]
            return {"depth": depth, "prim_id": prim_id, "count": count.astype(np.uint32)}
    raise InputError(f"cannot gather {what!r:.100}")
