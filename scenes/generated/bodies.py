"""Generated scenes without a ground: needles, shells, soup and spheres, in the cube from -1 to 1."""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

from scenes.generated.hashing import Floats, cube_root_step, points, uniform, unit
from scenes.generated.land import Triangles

_SHELLS, _FIRST_RADIUS, _NEXT_RADIUS = 6, 1.0, 0.8125
_SPHERE = 4
"""Parts of the edges of a sphere's octahedron: 128 triangles."""


def needles(triangles: int) -> Triangles:
    """Triangles 0.25 to 0.75 long and a hundredth of that wide, in all directions."""
    index = np.arange(triangles)
    centre, along, across = points(triangles, 0), unit(points(triangles, 3)), points(triangles, 6)
    half = (0.125 + 0.25 * uniform(index, 9))[:, None]
    corners = [centre - half * along, centre + half * along, centre + half * 0.02 * across]
    return _apart(np.stack(corners, axis=1))


def soup(triangles: int) -> Triangles:
    """Triangles of any shape, as large as so many would be that fill the cube."""
    size = 1.5 * cube_root_step(triangles)
    corners = [points(triangles, 3 + 3 * corner) * size for corner in range(3)]
    return _apart(points(triangles, 0)[:, None, :] + np.stack(corners, axis=1))


def _apart(corners: Floats) -> Triangles:
    """Triangles (N, 3, 3) that share no vertex."""
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def shells(triangles: int) -> Triangles:
    """Six spheres around each other: a ray through the middle meets twelve surfaces."""
    vertices, faces = _octahedron(max(1, isqrt(triangles // (8 * _SHELLS))))
    radii = np.asarray(_FIRST_RADIUS * np.cumprod([1.0, *[_NEXT_RADIUS] * (_SHELLS - 1)]), np.float64)
    return _repeated(vertices, faces, np.zeros((_SHELLS, 3)), radii)


def spheres(triangles: int) -> Triangles:
    """Spheres of 128 triangles, of several sizes, some inside others."""
    vertices, faces = _octahedron(_SPHERE)
    count = max(1, triangles // len(faces))
    radius = cube_root_step(count) * (0.5 + uniform(np.arange(count), 3))
    return _repeated(vertices, faces, points(count, 0), radius)


def _repeated(vertices: Floats, faces: NDArray[np.int64], centres: Floats, radii: Floats) -> Triangles:
    many = centres[:, None, :] + radii[:, None, None] * vertices[None]
    own = faces[None] + (len(vertices) * np.arange(len(centres)))[:, None, None]
    return many.reshape(-1, 3), own.reshape(-1, 3)


def _octahedron(parts: int) -> Triangles:
    """A unit sphere: each edge of an octahedron cut into so many parts, 8 parts^2 triangles, counterclockwise seen from
    outside. Vertices on shared edges are equal to the bit."""
    row, column = np.nonzero(np.tri(parts + 1, dtype=bool))
    number = row * (row + 1) // 2 + column
    inner = (column < row) & (row > 0)
    upright = np.stack([number - row, number, number + 1], axis=1)[column < row]
    inverted = np.stack([number - row - 1, number - row, number + 0], axis=1)[inner & (column > 0)]
    of_face = np.concatenate([upright, inverted[:, [0, 2, 1]]])
    vertices, faces = [], []
    for octant in range(8):
        x, y, z = (1.0 - 2.0 * (octant >> axis & 1) for axis in range(3))
        flat = np.stack([x * (row - column), y * (parts - row), z * column], axis=1)
        vertices.append(unit(flat.astype(np.float64)))
        faces.append((of_face if x * y * z < 0 else of_face[:, ::-1]) + octant * len(row))
    return np.concatenate(vertices), np.concatenate(faces)
