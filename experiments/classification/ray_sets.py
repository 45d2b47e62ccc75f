"""Ray sets: the rays of an image and those that start where they hit, as batches; the same to the bit for everyone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.rays.rays import Rays

KINDS = ("primary", "occlusion", "diffuse")
"""Rays of an image's pixels; from each place that they hit one ray to find whether something is near; and one
bounce."""

NEARBY = 0.2
"""How far rays of occlusion reach, in diagonals of the mesh's box."""

SHORTEST = 1e-4
"""Where rays that start on a triangle begin, in diagonals, lest they hit it."""


def ray_set(kind: str, mesh: Mesh, camera: View, hits: Hits, seed: int = 0) -> Rays:
    """One of KINDS. hits: an image of `mesh` seen by `camera`, from whose places secondary rays start.

    Secondary rays leave the side of the triangle that is seen, their directions spread as the cosine to its normal. Any
    hit will do for those of occlusion. seed: of the directions. Raises InputError for another kind.
    """
    if kind not in KINDS:
        raise InputError(f"kind of rays is {kind!r}, expected one of {', '.join(KINDS)}")
    if kind == "primary":
        y, x = np.mgrid[0 : camera.height, 0 : camera.width]
        origins, directions = camera.rays(x.ravel(), y.ravel(), hits.offset)
        return rays_between(_in_world(camera, origins) + np.asarray(camera.eye), _in_world(camera, directions))
    hit = hits.hit
    normals = hits.normals[hit].astype(np.float64)
    places = hits.points[hit].astype(np.float64)
    forward = np.asarray(camera.axes[2]) if camera.is_parallel else places - np.asarray(camera.eye)
    normals *= np.where((normals * forward).sum(axis=1) > 0.0, -1.0, 1.0)[:, None]
    directions = _around(normals, np.random.default_rng([seed, KINDS.index(kind)]))
    diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    reach = NEARBY * diagonal if kind == "occlusion" else np.inf
    return rays_between(places, directions, SHORTEST * diagonal, reach)


def rays_between(
    origins: NDArray[np.float64], directions: NDArray[np.float64], tnear: float = 0.0, tfar: float = np.inf
) -> Rays:
    """Rays in float32 with the same tnear and tfar."""
    ends = (np.full(len(origins), end, np.float32) for end in (tnear, tfar))
    return Rays(origins.astype(np.float32), directions.astype(np.float32), *ends)


def _in_world(camera: View, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors @ np.asarray(camera.axes))


def _around(normals: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """(N, 3) directions, spread as the cosine to the normals: the normal and a point of the unit sphere, added.

    What all but cancels keeps the normal's direction.
    """
    points = random.normal(size=normals.shape)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    directions = normals + points
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-3, directions / np.maximum(lengths, 1e-3), normals))
