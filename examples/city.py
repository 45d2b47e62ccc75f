"""What the examples of sun and sky share: a city of boxes, places on its faces, and pictures of a value per face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import atra

_COLOURS = np.array([(38, 38, 88), (70, 70, 160), (200, 90, 110), (250, 190, 70), (255, 250, 210)], np.float64)
"""From the least value to the largest."""


def rectangle(corner: tuple[float, ...], one: tuple[float, ...], other: tuple[float, ...], size: float) -> NDArray:
    """(F, 3, 3) float64 triangles of a rectangle with sides `one` and `other`, in squares of about `size`. Its normal
    is one x other."""
    start, a, b = (np.array(vector, float) for vector in (corner, one, other))
    m, n = (max(1, round(float(np.linalg.norm(side)) / size)) for side in (a, b))
    i, j = (grid.reshape(-1, 1) for grid in np.mgrid[0:m, 0:n])
    p, q, r, s = (start + (i + di) / m * a + (j + dj) / n * b for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])


def tower(x: float, y: float, width: float, depth: float, height: float, size: float) -> NDArray:
    """(F, 3, 3) float64, four walls and a roof, in metres; z is up, y is north."""
    w, d, h = (width, 0, 0), (0, depth, 0), (0, 0, height)
    return np.concatenate([
        rectangle((x, y, 0), w, h, size), rectangle((x + width, y, 0), d, h, size),
        rectangle((x + width, y + depth, 0), (-width, 0, 0), h, size),
        rectangle((x, y + depth, 0), (0, -depth, 0), h, size), rectangle((x, y, height), w, d, size),
    ])  # fmt: skip


def mesh_of(triangles: NDArray, name: str) -> atra.Mesh:
    """A mesh of (F, 3, 3) corners."""
    return atra.Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3), name)


def city(blocks: int = 5, size: float = 4.0, seed: int = 4) -> atra.Mesh:
    """Towers of 10 to 60 m on a square of ground, 40 m apart; size: of faces, metres."""
    random = np.random.default_rng(seed)
    parts = [rectangle((-20, -20, 0), (40.0 * blocks + 20, 0, 0), (0, 40.0 * blocks + 20, 0), size)]
    for x, y in np.ndindex(blocks, blocks):
        width, depth, height = random.uniform((14, 14, 10), (28, 28, 60))
        parts.append(tower(40.0 * x, 40.0 * y, width, depth, height, size))
    return mesh_of(np.concatenate(parts), "city")


def places(mesh: atra.Mesh, above: float = 1e-3) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(F, 3) float64 each: a place `above` the middle of each face, metres, and the face's unit normal."""
    corners = mesh.triangles(np.arange(mesh.triangle_count))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return corners.mean(axis=1) + above * normals, normals


def picture(mesh: atra.Mesh, values: NDArray[np.float64], width: int, height: int) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: the city from the south-west, each face in the colour of its value."""
    low, high = mesh.bounds
    middle, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    eye, target = middle + reach * np.array((-0.4, -0.75, 0.8)), middle - (0, 0, 0.05 * reach)
    camera = atra.Camera(tuple(eye), tuple(target), (0, 0, 1), 38.0, width, height)
    with atra.RasterTracer(mesh, camera) as tracer:
        hits = tracer.trace()
    share = (values - values.min()) / max(float(np.ptp(values)), 1e-9) * (len(_COLOURS) - 1)
    stops = np.arange(len(_COLOURS))
    colours = np.stack([np.interp(share, stops, channel) for channel in _COLOURS.T], axis=1)
    image = np.full((height, width, 3), 235.0)
    image[hits.hit] = colours[hits.prim_id[hits.hit]]
    return np.rint(image).astype(np.uint8)
