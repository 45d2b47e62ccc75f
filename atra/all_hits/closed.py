"""Closed meshes: those without open edges, which have an inside."""

from __future__ import annotations

from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh

_NAMED = 3
"""Open edges named in an error."""

_closed: WeakSet[Mesh] = WeakSet()
"""Meshes known to be closed. The check takes longer than a frame, and a mesh never changes."""


def open_edges(mesh: Mesh) -> NDArray[np.int64]:
    """(N, 2) int64: edges, as pairs of vertices, that triangles traverse more often in this direction than in the
    other.

    Vertices at one position count as one, named by the lowest number. Any number of triangles may share an edge.
    """
    return edge_surplus(mesh.local, mesh.faces)[0]


def edge_surplus(mesh: Mesh, faces: NDArray[np.uint32]) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
    """(edges, surplus, odd) of some triangles, (F, 3), of a mesh: (E, 2) int64, `open_edges`; (E,) int64, how much more
    often each is traversed; and the number of edges with an odd number of triangles."""
    lowest, same = np.unique(mesh.vertices + np.float32(0.0), axis=0, return_index=True, return_inverse=True)[1:]
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


def check_closed(mesh: Mesh) -> None:
    """Raise InputError for a mesh with open edges, naming some, and for one that is inside out."""
    if mesh in _closed:
        return
    edges = open_edges(mesh)
    if len(edges):
        named = ", ".join(f"{a}-{b}" for a, b in edges[:_NAMED].tolist())
        raise InputError(
            f"{mesh.name!r} is not closed, so it has no thickness: it has {len(edges)} open edges, first {named} "
            "(vertices); close its holes and orient its triangles alike"
        )
    corners = mesh.local_vertices.astype(np.float64)[mesh.faces] - mesh.local.bounds.mean(axis=0)
    volume = float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0
    if volume < 0.0:
        raise InputError(
            f"{mesh.name!r} is inside out, its volume is {volume:g}; make its triangles counterclockwise "
            "seen from outside"
        )
    _closed.add(mesh)
