"""Small meshes the tests share."""

from __future__ import annotations

import numpy as np

import atra
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box

EYE_AT_ORIGIN = {"eye": (0, 0, 0), "target": (0, 0, 1), "up": (0, 1, 0)}
"""A camera looking along world +z: camera space is X right = world -x, Y down = world -y, Z = world z."""


def quads(corners: list[list[tuple[float, float, float]]], name: str = "quads") -> atra.Mesh:
    """A mesh of two triangles per quadrilateral."""
    vertices = np.array([corner for quad in corners for corner in quad], np.float32)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]], axis=1).reshape(-1, 3)
    return atra.Mesh(vertices, faces, name)


def random_triangles(count: int, seed: int, size: float = 1.0, spread: float = 3.0) -> atra.Mesh:
    """Triangles all around the origin: in front of the eye, behind it and through its plane."""
    random = np.random.default_rng(seed)
    centres = random.uniform(-spread, spread, (count, 1, 3))
    vertices = (centres + random.normal(0, size, (count, 3, 3))).reshape(-1, 3)
    return atra.Mesh(vertices, np.arange(3 * count).reshape(-1, 3), "random triangles")


def cornell_camera(width: int, height: int) -> atra.Camera:
    return atra.Camera(**CORNELL_BOX_CAMERA, width=width, height=height)


__all__ = ["EYE_AT_ORIGIN", "cornell_box", "cornell_camera", "quads", "random_triangles"]
