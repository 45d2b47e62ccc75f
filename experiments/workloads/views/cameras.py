"""Cameras as photographs have them: K, R and t of a few steps around a view."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, radians, sin

import numpy as np

from atra.geometry.camera import CalibratedCamera, Camera
from atra.geometry.mesh import Mesh

STEP, TURN_DEGREES = 1 / 50, 30.0
"""How far eyes lie from the view's, as a share of the scene's diagonal, and how far they are turned at most."""


def cameras_around(camera: Camera, mesh: Mesh, count: int) -> tuple[CalibratedCamera, ...]:
    """`count` cameras with an eye each, pixels that are not square and a principal point that is not in the middle."""
    diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    focal = 1 / camera.pixel_pitch
    K = np.array([[1.05 * focal, 0, 0.45 * camera.width], [0, focal, 0.55 * camera.height], [0, 0, 1]])
    right, down, forward = camera.axes
    made = []
    for place in np.arange(count) / count * 2 * pi:
        eye = np.add(camera.eye, STEP * diagonal * (cos(place) * right + sin(place) * forward))
        turn = radians(TURN_DEGREES) * sin(place)
        R = np.stack([cos(turn) * right - sin(turn) * forward, down, sin(turn) * right + cos(turn) * forward])
        made.append(Camera.from_opencv(K, R, -R @ eye, camera.width, camera.height))
    return tuple(made)


def camera_rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions, (H W, 3) float32 each, through the centres of all pixels, row after row."""
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = replace(camera).rays(x, y, (0.5, 0.5))
    return (
        (origins @ camera.axes + camera.eye).astype(np.float32),
        np.ascontiguousarray(directions @ camera.axes, np.float32),
    )


def random_rays(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions, (count, 3) float32 each: from anywhere in the mesh's box, every way as likely."""
    random = np.random.default_rng(1)
    low, high = mesh.bounds
    return random.uniform(low, high, (count, 3)).astype(np.float32), random.normal(size=(count, 3)).astype(np.float32)
