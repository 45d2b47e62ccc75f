"""Needles near the eye: the meshes on which sheared copies were wrong at ordinary fields of view."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import atra

FIELDS_OF_VIEW_DEGREES = (60.0, 90.0, 120.0, 150.0)
SPLITS = ((8, 1), (16, 16), (1, 8), (64, 1))


def beams(seed: int, count: int = 80) -> atra.Mesh:
    """Long thin triangles around the eye, some of them along an axis, as floors and beams are."""
    random = np.random.default_rng(seed)
    centre = random.normal(size=(count, 3)) * random.choice([0.3, 1.0, 3.0], (count, 1))
    along = random.normal(size=(count, 3))
    straight = random.random(count) < 0.3
    along[straight] = np.eye(3)[random.integers(0, 3, straight.sum())]
    along *= random.choice([3.0, 20.0, 100.0], (count, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    across = random.normal(size=(count, 3)) * random.choice([0.02, 0.1, 0.5], (count, 1))
    corners = np.stack([centre - along, centre + along, centre + across + random.random((count, 1)) * along], axis=1)
    return atra.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), f"beams {seed}")


def needle_camera(seed: int, fov_y_degrees: float, size: int = 64) -> atra.Camera:
    """At the origin, along an axis or anywhere."""
    random = np.random.default_rng([seed, 1])
    target = np.array([0.0, 0.0, -1.0]) if seed % 2 else random.normal(size=3)
    return atra.Camera((0, 0, 0), tuple(target), (0.1, 1, 0.2), fov_y_degrees, size, size)


def methods(mesh: atra.Mesh, camera: atra.Camera, split: tuple[int, int]) -> Iterator[tuple[str, object]]:
    """Every method that shears, one thread each."""
    yield "copied", atra.AlignedTracer(mesh, camera, split, threads=1)
    yield "instanced", atra.AlignedTracer(mesh, camera, split, culling=False, geometry="instanced", threads=1)
    yield "visible_first", atra.VisibleFirstTracer(mesh, camera, split, threads=1)
