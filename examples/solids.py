"""Closed solids: a ball, a box, and a parcel to look into, for the examples that need an inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

import atra
from atra.geometry.view import View
from examples import parts

BALL_RADIUS = 1.0
BOX = np.array([(-0.9, -0.5, -0.7), (0.9, 0.5, 0.7)])
_WALL = 0.05
_SEEN_FROM = np.array([0.45, 0.62, 0.75])


def ball(subdivisions: int = 5) -> atra.Mesh:
    """A geodesic ball about the origin, its corners at BALL_RADIUS."""
    found = trimesh.creation.icosphere(subdivisions, BALL_RADIUS)
    return atra.Mesh(found.vertices, found.faces, "ball")


def box() -> atra.Mesh:
    found = trimesh.creation.box(bounds=BOX)
    return atra.Mesh(found.vertices, found.faces, "box")


def parcel() -> atra.Mesh:
    """A thin-walled box with a ring, a hollow ball, a pill and a tube in it, none of which touch."""
    low, high = np.array([(-1.2, -0.7, -0.9), (1.2, 0.7, 0.9)])
    cavity = trimesh.creation.box(bounds=[low + _WALL, high - _WALL])
    hollow = trimesh.creation.icosphere(4, 0.32)
    for inner in (cavity, hollow):
        inner.invert()
    at = trimesh.transformations.translation_matrix
    tilted = trimesh.transformations.rotation_matrix(0.5, (1, 0, 0.4))
    found = trimesh.util.concatenate(
        [
            trimesh.creation.box(bounds=[low, high]),
            cavity,
            trimesh.creation.torus(0.38, 0.13, 96, 48, transform=at((-0.55, 0.0, 0.3)) @ tilted),
            trimesh.creation.icosphere(4, 0.42).apply_transform(at((0.6, 0.05, 0.38))),
            hollow.apply_transform(at((0.6, 0.05, 0.38))),
            trimesh.creation.capsule(0.5, 0.16, count=(48, 48), transform=at((-0.55, -0.2, -0.43))),
            trimesh.creation.annulus(0.12, 0.22, 0.5, 64, transform=at((0.55, -0.05, -0.46)) @ tilted),
        ]
    )
    return atra.Mesh(found.vertices, found.faces, "parcel")


SOLIDS = {"ball": ball, "box": box, "parcel": parcel}


def pose_of(mesh: atra.Mesh) -> dict[str, Any]:
    """The fields of a camera that sees the whole mesh from above."""
    middle, size = mesh.bounds.mean(axis=0), float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    eye = middle + 1.6 * size * _SEEN_FROM / np.linalg.norm(_SEEN_FROM)
    return {"eye": tuple(eye.tolist()), "target": tuple(middle.tolist()), "fov_y_degrees": 34.0}


def load(name: str) -> tuple[atra.Mesh, dict[str, Any]]:
    """A solid or another scene, and the fields of its camera."""
    if name not in SOLIDS:
        return parts.load(name)
    mesh = SOLIDS[name]()
    return mesh, pose_of(mesh)


def views(mesh: atra.Mesh, pose: dict[str, Any], width: int, height: int) -> dict[str, View]:
    """Both kinds of camera, the parallel one along the other's axis."""
    pinhole = atra.Camera(**pose, width=width, height=height)
    x, y, z = pinhole.axes[2].tolist()
    parallel = atra.OrthographicCamera.of_light((x, y, z), mesh.bounds, width, height, pinhole.up)
    return {"parallel": parallel, "pinhole": pinhole}
