"""Gathering by arithmetic on the list of all crossings: slow, and what the kernels are compared with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.gathering.crossings import Crossings, all_crossings
from atra.gathering.reductions import Count, Gathered, Layers, Reduction, Thickness, Transmittance
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS


def gather_plainly(
    mesh: Mesh, camera: View, what: Reduction[Gathered], offset: tuple[float, float] = (0.5, 0.5)
) -> Gathered:
    """`what` of every pixel, by testing every triangle. Raises InputError as `gather` of a tracer does."""
    weights = what.weights(mesh)
    arrays = _reduced(what, weights, all_crossings(mesh, camera, offset), camera.width * camera.height)
    shape = (camera.height, camera.width)
    shaped = {name: array.reshape(array.shape[:-1] + shape) for name, array in arrays.items()}
    return what.result(**shaped, offset=offset, mesh=mesh, camera=camera)


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
