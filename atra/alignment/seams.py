"""Seams: where triangles that sheared copies show meet triangles that only rays of the mesh itself show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.positions import position_keys


def with_neighbours(mesh: Mesh, prim_ids: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(F,) bool: the triangles `prim_ids`, (N,), N > 0, and all that share a corner's position with one of them.

    Copies and the mesh itself are rounded differently, so a ray could slip through between a triangle of the one and a
    neighbour of the other. Where rays are also shot at the neighbours, as the mesh has them, none can.
    """
    keys = position_keys(mesh)
    wanted = np.unique(keys[mesh.faces[prim_ids]])
    found = np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)
    is_near: NDArray[np.bool_] = (wanted[found] == keys)[mesh.faces].any(axis=1)
    return is_near
