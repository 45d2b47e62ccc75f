"""Whether points lie inside a mesh: by parity where it is closed, else by the generalised winding number."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.rays.all_hits.finding import Crossings
from atra.rays.rays import SMALLEST

METHODS = ("parity", "winding")

_EDGES = 1 << 18
"""Pairs of a point and an open edge whose solid angles are computed at a time."""


FARTHEST = 1e19
"""Largest size of points whose way to a mesh is computed."""


def check_points(points: ArrayLike, farthest: float = np.inf) -> NDArray[np.float64]:
    """(P, 3) float64, numbers below `SMALLEST` being 0. Raises InputError for another shape or dtype, and naming the
    first that is not finite or beyond `farthest` in size."""
    try:
        array = np.asarray(points)
    except (TypeError, ValueError) as error:
        raise InputError(f"points cannot be read as an array: {error}") from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"points have dtype {array.dtype}, expected real numbers")
    if array.size == 0 and array.ndim < 2:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"points have shape {array.shape}, expected (P, 3)")
    found = np.ascontiguousarray(array, np.float64)
    with np.errstate(invalid="ignore"):
        good = (np.isfinite(found) & (np.abs(found) <= farthest)).all(axis=1)
    if not good.all():
        first = int(np.argmin(good))
        most = f" of at most {farthest:g} in size" if farthest < np.inf else ""
        raise InputError(f"point {first} is {tuple(found[first].tolist())}, expected finite numbers{most}")
    return np.where(np.abs(found) < SMALLEST, 0.0, found)


def edge_surplus(mesh: Mesh, faces: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """(edges, surplus, odd): (E, 2) int64 edges as pairs of vertices that triangles traverse more often in this
    direction than in the other, (E,) int64 how much more often, and the number of edges with an odd number of
    triangles. Vertices at one position count as one."""
    places = mesh.vertices + np.float32(0.0)
    lowest, same = np.unique(places, axis=0, return_index=True, return_inverse=True)[1:]
    corners = lowest[same.reshape(-1)][faces]
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    edges = edges[edges[:, 0] != edges[:, 1]]
    key = edges.min(axis=1) * np.int64(len(mesh.vertices)) + edges.max(axis=1)
    names, place, times = np.unique(key, return_inverse=True, return_counts=True)
    surplus = np.bincount(place.reshape(-1), np.sign(edges[:, 1] - edges[:, 0]), len(names)).astype(np.int64)
    is_open = surplus != 0
    pairs = np.stack(np.divmod(names[is_open], len(mesh.vertices)), axis=1)
    pairs[surplus[is_open] < 0] = pairs[surplus[is_open] < 0][:, ::-1]
    return pairs, np.abs(surplus[is_open]), int((times % 2).sum())


def winding_numbers(
    points: NDArray[np.float64],
    ends: NDArray[np.float64],
    surplus: NDArray[np.int64],
    crossings: Crossings,
) -> NDArray[np.float64]:
    """(P,) float64, the generalised winding number of a mesh around each point.

    ends: (E, 2, 3) float64, the open edges. surplus: (E,), how often each is open. Curtains from the open edges to
    infinity close the mesh. Those that head against the ray of a point do not cross it. So the winding number is the
    sum of the signs of the ray's crossings, less the curtains' solid angles.
    Source: A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding
    numbers", 2013; C. Martens, M. Bessmeltsev, "One-shot method for computing generalized winding numbers", 2025.
    """
    ways = crossings.columns(points, everywhere=True)
    found = ways.turns.astype(np.float64)
    step = max(1, _EDGES // max(1, len(ends)))
    for start in range(0, len(points) if len(ends) else 0, step):
        some = slice(start, start + step)
        a = ends[None, :, 0] - points[some, None]
        b = ends[None, :, 1] - points[some, None]
        d = -ways.directions[some, None]
        sizes = np.linalg.norm(a, axis=2), np.linalg.norm(b, axis=2)
        volume = (np.cross(a, b) * d).sum(axis=2)
        rest = (
            sizes[0] * sizes[1] + (a * b).sum(axis=2) + (a * d).sum(axis=2) * sizes[1] + (b * d).sum(axis=2) * sizes[0]
        )
        found[some] += (2.0 * np.arctan2(volume, rest) * surplus).sum(axis=1) / (4.0 * np.pi)
    return found
