"""What Embree is given so that no hit is lost: triangles a little larger than the mesh's, whose rims are in doubt.

Rays through corners may slip through between triangles that meet there, as float32 decides for each triangle by itself.
Larger triangles overlap. A hit on what was added, or as near to an edge, is decided anew without rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import padded_vertices
from atra.rays.enlarged_kernels import Doubts, enlarge_triangles, measure_triangles

REACH = 4.0
"""How far from the mesh's middle rays may start, in sizes of its box, that Embree is asked for."""

_SHARE, _LARGE = 2.0**-8, 2.0**-7
"""Margin around a triangle as a share of its least height, and the height, in sizes of the mesh, above which margins do
not grow. With larger ones more hits are in doubt; with smaller ones rays that pass corners all but edge-on are lost."""

_ROUNDING = 16 * 2.0**-24
"""Least margin, which Embree's fast test rounds by, as a share of the longest way to a triangle."""


class Enlarged(NamedTuple):
    """vertices: (3 F, 3) float32, padded for Embree. faces: (F, 3) uint32. rims: (F,) float32, those of `doubts`."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    rims: NDArray[np.float32]
    doubts: Doubts


def enlarged(mesh: Mesh, kept: NDArray[np.bool_] | None) -> Enlarged:
    """The triangles of a mesh for Embree, and which of their hits are in doubt. kept: (F,) bool; None: all."""
    count, faces = mesh.triangle_count, mesh.traced_faces
    heights = np.empty(count)
    measure_triangles(mesh.vertices, faces, np.ones(count, np.bool_) if kept is None else kept, heights)
    low, high = mesh.bounds
    size = float((high - low).max())
    reach = REACH * size
    error = _ROUNDING * (reach + size)
    margins = np.maximum(_SHARE * np.minimum(heights, _LARGE * size), error)
    vertices, numbers, rims = padded_vertices(3 * count), np.empty((count, 3), np.uint32), np.empty(count, np.float32)
    middle = ((low + high) / 2).astype(np.float32)
    x, y, z = middle
    given = mesh.vertices, faces, middle.astype(np.float64), heights, margins
    enlarge_triangles(*given, vertices.reshape(-1, 3, 3), numbers, rims)
    return Enlarged(vertices, numbers, rims, Doubts(rims.ctypes.data, x, y, z, np.float32(reach)))
