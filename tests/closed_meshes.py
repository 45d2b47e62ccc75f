"""Closed meshes that tests share, their triangles counterclockwise seen from outside."""

from __future__ import annotations

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


def view_of(mesh: atra.Mesh, seed: int, width: int = 48, height: int = 32) -> atra.Camera:
    """A camera anywhere outside, which looks somewhere near the middle."""
    random = np.random.default_rng([seed, 7])
    middle, size = mesh.bounds.mean(axis=0), float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    way = random.normal(size=3)
    eye = middle + way / np.linalg.norm(way) * size * random.uniform(0.6, 2.0)
    target = middle + random.normal(size=3) * 0.1 * size
    return atra.Camera(tuple(eye), tuple(target), (0.1, 1.0, 0.3), random.uniform(20, 100), width, height)
