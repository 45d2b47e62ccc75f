"""Closed meshes: those that have an inside, because no edge of theirs is open."""

from __future__ import annotations

from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh

_NAMED = 3
"""Edges that an error names."""

_closed: WeakSet[Mesh] = WeakSet()
"""Meshes that were found closed, which takes longer than a frame; a mesh never changes."""


def open_edges(mesh: Mesh) -> NDArray[np.int64]:
    """(N, 2) int64, pairs of vertices whose edge triangles pass more often this way than the other.

    Vertices of one position count as one, and the lowest of them is named; how many triangles share an edge does not
    matter, as long as they pass it as often one way as the other.
    """
    lowest, same = np.unique(mesh.vertices + np.float32(0.0), axis=0, return_index=True, return_inverse=True)[1:]
    faces = lowest[same.reshape(-1)][mesh.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    low, high = edges.min(axis=1), edges.max(axis=1)
    key = low * np.int64(len(mesh.vertices)) + high
    names, place = np.unique(key, return_inverse=True)
    surplus = np.bincount(place.reshape(-1), np.sign(edges[:, 1] - edges[:, 0]), len(names))
    found = np.flatnonzero(surplus)
    pairs = np.stack(np.divmod(names[found], len(mesh.vertices)), axis=1)
    return np.where(surplus[found, None] > 0, pairs, pairs[:, ::-1])


def check_closed(mesh: Mesh) -> None:
    """Raise InputError, naming edges, for a mesh that is not closed, and for one that is inside out."""
    if mesh in _closed:
        return
    edges = open_edges(mesh)
    if len(edges):
        named = ", ".join(f"{a}-{b}" for a, b in edges[:_NAMED].tolist())
        raise InputError(
            f"{mesh.name!r} is not closed, so it has no thickness: {len(edges)} edges are passed more often one way "
            f"than the other, first {named} (vertices); close its holes, and turn its triangles alike"
        )
    corners = mesh.vertices.astype(np.float64)[mesh.faces] - mesh.bounds.mean(axis=0)
    volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
    if volume < 0.0:
        raise InputError(
            f"{mesh.name!r} is inside out, its volume is {volume:g}; turn its triangles so that they run "
            "counterclockwise, seen from outside"
        )
    _closed.add(mesh)
