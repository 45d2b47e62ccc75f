"""Generated scenes with a ground: terrain, city and forest. y is up; each fits a square of side `SIDE` about the
origin, but for the forest, which grows with its trees."""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

from scenes.generated.hashing import Floats, uniform

Triangles = tuple[Floats, NDArray[np.int64]]
"""Vertices (V, 3) and faces (F, 3)."""

SIDE = 100.0

_OCTAVES, _HEIGHT = 7, 16.0

_BOX = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]], np.float64)
_BOX_FACES = np.array(
    [
        [0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 5, 1], [0, 4, 5],
        [1, 6, 2], [1, 5, 6], [2, 7, 3], [2, 6, 7], [3, 4, 0], [3, 7, 4],
    ]
)  # fmt: skip

_LEAVES = 120
_TRUNK = np.array([[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 7, 6], [3, 0, 7], [0, 4, 7]])
_TREE_STEP = 4.0
"""Distance between neighbouring trees."""


def terrain(triangles: int) -> Triangles:
    """A height field of a square grid: seven octaves of noise between hashed heights."""
    side = max(1, isqrt(triangles // 2))
    line = np.arange(side + 1)
    heights = np.zeros((side + 1, side + 1))
    for octave in range(_OCTAVES):
        heights += 0.5**octave * _noise(line, side, 4 << octave, octave)
    x = (line / side - 0.5) * SIDE
    grid = np.stack(np.broadcast_arrays(x[None, :], _HEIGHT * 0.5 * heights, x[:, None]), axis=-1)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    below = corner + side + 1
    faces = np.stack([corner, below, corner + 1, corner + 1, below, below + 1], axis=1).reshape(-1, 3)
    return grid.reshape(-1, 3), faces


def _noise(line: NDArray[np.int64], side: int, cells: int, octave: int) -> Floats:
    """(N, N) heights in [0, 1) between those at the corners of so many cells along each side."""
    place = line * cells / side
    cell = np.minimum(place.astype(np.int64), cells - 1)
    part = place - cell
    weight = part * part * (3.0 - 2.0 * part)

    def corners(row: int, column: int) -> Floats:
        return uniform((cell[:, None] + row) * (cells + 1) + cell[None, :] + column, octave)

    across = weight[None, :]
    upper = corners(0, 0) * (1.0 - across) + corners(0, 1) * across
    lower = corners(1, 0) * (1.0 - across) + corners(1, 1) * across
    return np.asarray(upper * (1.0 - weight[:, None]) + lower * weight[:, None])


def city(triangles: int) -> Triangles:
    """Boxes on a square grid with streets between them: many low ones, few high ones."""
    count = max(1, (triangles - 2) // 12)
    rows = _root_above(count)
    step = SIDE / rows
    index = np.arange(count)
    corner = np.stack([index % rows, np.zeros(count), index // rows], axis=1) * step - [SIDE / 2, 0.0, SIDE / 2]
    tall = uniform(index, 0)
    size = np.stack(
        [0.5 + 0.3 * uniform(index, 1), 0.4 + 4.0 * tall * tall * tall, 0.5 + 0.3 * uniform(index, 2)], axis=1
    )
    vertices = np.asarray(corner[:, None, :] + _BOX[None] * (size * step)[:, None, :], np.float64)
    faces = _BOX_FACES[None] + 8 * index[:, None, None]
    return _on_ground(vertices.reshape(-1, 3), faces.reshape(-1, 3), SIDE)


def forest(triangles: int) -> Triangles:
    """Trees of 128 triangles on a square grid: a square trunk, and leaves of one triangle each."""
    count = max(1, (triangles - 2) // (_LEAVES + len(_TRUNK)))
    rows = _root_above(count)
    index = np.arange(count)
    foot = np.stack([index % rows, np.zeros(count), index // rows], axis=1) - [rows // 2, 0.0, rows // 2]
    foot[:, 0] += 0.3 + 0.4 * uniform(index, 0)
    foot[:, 2] += 0.3 + 0.4 * uniform(index, 1)
    foot *= _TREE_STEP
    height = 4.0 + 4.0 * uniform(index, 2)
    trunk = (
        foot[:, None, :]
        + (_BOX - [0.5, 0.0, 0.5])[None]
        * np.stack([np.full(count, 0.25), 0.6 * height, np.full(count, 0.25)], axis=1)[:, None, :]
    )
    leaf = np.arange(count * _LEAVES)
    spread = [uniform(leaf, channel) + uniform(leaf, channel + 1) - 1.0 for channel in (3, 5, 7)]
    tree = leaf // _LEAVES
    centre = foot[tree] + np.stack([1.6 * spread[0], height[tree] * (0.65 + 0.35 * spread[1]), 1.6 * spread[2]], axis=1)
    corners = np.stack(
        [np.stack([uniform(leaf, 9 + 3 * k + axis) - 0.5 for axis in range(3)], axis=1) for k in range(3)], axis=1
    )
    leaves = centre[:, None, :] + 0.5 * corners
    faces = [
        (_TRUNK[None] + 8 * index[:, None, None]).reshape(-1, 3),
        8 * count + np.arange(3 * len(leaf)).reshape(-1, 3),
    ]
    vertices = np.concatenate([trunk.reshape(-1, 3), leaves.reshape(-1, 3)])
    return _on_ground(vertices, np.concatenate(faces), _TREE_STEP * (rows + 2))


def _on_ground(vertices: Floats, faces: NDArray[np.int64], side: float) -> Triangles:
    """With a square of two triangles at the height 0 below."""
    half = side / 2
    ground = np.array([[-half, 0, -half], [-half, 0, half], [half, 0, half], [half, 0, -half]])
    of_ground = len(vertices) + np.array([[0, 1, 2], [0, 2, 3]])
    return np.concatenate([vertices, ground]), np.concatenate([faces, of_ground])


def _root_above(number: int) -> int:
    """The smallest whole number whose square is not smaller."""
    root = isqrt(number)
    return root if root * root == number else root + 1
