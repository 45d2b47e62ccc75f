"""Closed meshes that tests share, their triangles counterclockwise seen from outside."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh

import atra
from tests.meshes import joined


def box(low: tuple[float, float, float] = (-1, -1, -1), high: tuple[float, float, float] = (1, 1, 1)) -> atra.Mesh:
    """The corners of both on a grid of eighths lie exactly on samples of an orthographic view of eighths."""
    found = trimesh.creation.box(bounds=[low, high])
    return atra.Mesh(found.vertices, found.faces, "box")


def sphere(subdivisions: int = 2, radius: float = 1.0) -> atra.Mesh:
    found = trimesh.creation.icosphere(subdivisions, radius)
    return atra.Mesh(found.vertices, found.faces, f"icosphere {subdivisions}")


def cornell_boxes() -> atra.Mesh:
    """The two boxes of a Cornell box, whole: turned, side by side, one twice as high."""
    boxes = []
    for degrees, (x, z), height in ((17.0, (0.33, 0.37), 0.6), (-20.0, (-0.33, -0.29), 1.2)):
        turn = trimesh.transformations.rotation_matrix(np.deg2rad(degrees), (0, 1, 0))
        found = trimesh.creation.box((0.6, height, 0.6), turn)
        boxes.append(atra.Mesh(found.vertices + (x, height / 2, z), found.faces))
    return joined(*boxes)


@cache
def three_holes(across: int = 27) -> atra.Mesh:
    """A bent plate of 7 x 3 x 1 blocks with three of them missing: genus 3, 136 across^2 triangles."""
    solid = np.zeros((9, 5, 3), bool)
    solid[1:8, 1:4, 1] = True
    solid[[2, 4, 6], 2, 1] = False
    grid = np.arange(across)
    corners = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for way in (-1, 1):
            for block in np.argwhere(solid & ~np.roll(solid, -way, axis)):
                at = np.zeros((across, across, 4, 3), np.int64)
                at[..., axis] = (block[axis] + (way > 0)) * across
                steps = [(0, 0), (1, 0), (1, 1), (0, 1)]
                for corner, (du, dv) in enumerate(steps if way > 0 else steps[::-1]):
                    at[:, :, corner, u] = block[u] * across + grid[:, None] + du
                    at[:, :, corner, v] = block[v] * across + grid + dv
                corners.append(at.reshape(-1, 4, 3))
    places, numbers = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    quads = numbers.reshape(-1, 4)
    x, y, z = (places / across - (4.5, 2.5, 1.5)).T
    bent = np.stack([x, y + 0.3 * np.sin(x), z + 0.4 * np.cos(y + 0.5 * x)], axis=1)
    return atra.Mesh(bent, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), "three holes")


def view_of(mesh: atra.Mesh, seed: int, width: int = 48, height: int = 32) -> atra.Camera:
    """A camera anywhere outside, which looks somewhere near the middle."""
    random = np.random.default_rng([seed, 7])
    middle, size = mesh.bounds.mean(axis=0), float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    way = random.normal(size=3)
    eye = middle + way / np.linalg.norm(way) * size * random.uniform(0.6, 2.0)
    target = middle + random.normal(size=3) * 0.1 * size
    return atra.Camera(tuple(eye), tuple(target), (0.1, 1.0, 0.3), random.uniform(20, 100), width, height)
