"""Batches of rays that several workloads ask about: of a camera, and random ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh

Batch = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Origins and directions, (N, 3) each."""


def camera_rays(camera: Camera) -> Batch:
    """Through the centres of all pixels, row after row."""
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(x, y, (0.5, 0.5))
    axes = np.asarray(camera.axes)
    return (origins @ axes + camera.eye).astype(np.float32), np.ascontiguousarray(directions @ axes, np.float32)


def random_rays(mesh: Mesh, count: int) -> Batch:
    """From anywhere in the mesh's box, every way as likely."""
    random = np.random.default_rng(1)
    low, high = mesh.bounds
    return random.uniform(low, high, (count, 3)).astype(np.float32), random.normal(size=(count, 3)).astype(np.float32)
