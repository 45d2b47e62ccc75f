"""Origins of meshes: float32 keeps the vertices of a mesh far from the world's origin only around one of its own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

MOST_MOVED = 1e-7
"""Largest share of a mesh's size by which float32 may move its vertices in the world; beyond it gets an origin."""

NOTICED, _FEW = 0.05, 0.01
"""Detail is lost where float32 changes the shortest edge by more than this share of its length, in more than this share
of the triangles."""

_BLOCK = 1 << 16
"""Vertices that are rounded at a time, which bounds the memory beside them."""

NEAR_ZERO = 0.5
"""An axis keeps zero where the box comes nearer to it than this share of the size: float64 has finer steps there than
at the box's centre, so subtracting that would round."""

_SAMPLE = 4096
"""Triangles, evenly spread, that show how large a mesh is at least, and whether its edges lose detail."""


def around_origin(
    vertices: NDArray[np.floating], faces: NDArray[np.uint32]
) -> tuple[NDArray[np.float32], NDArray[np.float64], str]:
    """(local, origin, loss): vertices (V, 3) float32 around an origin (3,) float64, and what float32 loses even so.

    The origin is zero where float32 moves no vertex of a face by more than MOST_MOVED of the mesh's size, as it never
    does for float32 and smaller types. Else each of its components is that of the box's centre, rounded to the power of
    two at or below the size, or zero where the box comes near to zero. Then float64 subtracts it from points in the box
    without rounding, and local coordinates are at most 1.5 times the size. loss: "" for none.
    """
    local, origin = np.empty(vertices.shape, np.float32), np.zeros(3)
    if np.can_cast(vertices.dtype, np.float32):
        local[:] = vertices
        return local, origin, ""
    some = faces[np.linspace(0, len(faces) - 1, min(len(faces), _SAMPLE)).astype(np.int64)]
    corners = vertices[some].astype(np.float64)
    least_size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    largest = np.float32(max(-float(vertices.min()), float(vertices.max())))
    if np.spacing(largest) / 2.0 > MOST_MOVED * least_size:  # otherwise no vertex can be moved so far
        origin = _origin_needed(vertices, faces)
    if origin.any():
        for block in _blocks(len(vertices)):
            local[block] = vertices[block].astype(np.float64) - origin
    else:
        local[:] = vertices
    return local, origin, _loss(corners - origin, local[some].astype(np.float64))


def _origin_needed(vertices: NDArray[np.floating], faces: NDArray[np.uint32]) -> NDArray[np.float64]:
    """The origin of `around_origin`, by looking at every vertex of a face."""
    is_used = np.zeros(len(vertices), np.bool_)
    is_used[faces] = True
    low, high, moved = np.full(3, np.inf), np.full(3, -np.inf), 0.0
    for block in _blocks(len(vertices)):
        used = vertices[block][is_used[block]].astype(np.float64)
        if len(used):
            moved = max(moved, float(np.abs(used.astype(np.float32) - used).max()))
            low, high = np.minimum(low, used.min(axis=0)), np.maximum(high, used.max(axis=0))
    size = float((high - low).max())
    return _origin_of(low, high, size) if moved > MOST_MOVED * size else np.zeros(3)


def _blocks(count: int) -> Iterator[slice]:
    return (slice(start, start + _BLOCK) for start in range(0, count, _BLOCK))


def _origin_of(low: NDArray[np.float64], high: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    centre = low + (high - low) / 2.0
    if size == 0.0:
        return centre
    step = float(np.ldexp(0.5, np.frexp(size)[1]))
    with np.errstate(over="ignore"):
        steps = np.round(centre / step)
    origin = np.where(np.isfinite(steps), steps * step, centre) + 0.0  # no -0.0
    return np.where(np.maximum(low, -high) < NEAR_ZERO * size, 0.0, origin)


def _loss(before: NDArray[np.float64], after: NDArray[np.float64]) -> str:
    """What rounding takes from triangles, (N, 3, 3): triangle, corner, axis."""
    edges = before - np.roll(before, 1, axis=1)
    lengths = np.linalg.norm(edges, axis=2)
    lengths[lengths == 0.0] = np.inf
    shortest = lengths.argmin(axis=1)[:, None]
    off = np.linalg.norm(after - np.roll(after, 1, axis=1) - edges, axis=2)
    length, off = (np.take_along_axis(array, shortest, axis=1)[:, 0] for array in (lengths, off))
    is_lost = (off > NOTICED * length) & (length < np.inf)
    if is_lost.mean() <= _FEW:
        return ""
    size, step = np.ptp(before.reshape(-1, 3), axis=0).max(), np.spacing(np.float32(np.abs(after).max()))
    return (
        f"spans {size:g} and is kept in float32, in steps of {step:.2g}, which changes edges as short as "
        f"{length[is_lost].min():.2g} by more than {NOTICED:.0%}; cut it into parts that span less"
    )
