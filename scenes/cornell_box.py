"""A Cornell box made of numbers: the 1,112 triangles of the paper's smallest scene, with no file.

The paper gives the triangle count but not the geometry, so the design is ours: an open room with a ceiling light, one
turned box and one sphere.
"""

from __future__ import annotations

from math import cos, pi, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh

CORNELL_BOX_CAMERA: dict[str, Any] = {
    "eye": (0.0, 0.8, 2.3),
    "target": (0.0, 0.8, -1.0),
    "up": (0.0, 1.0, 0.0),
    "fov_y_degrees": 45.0,
}
"""Looks through the open side along -z; fields of `atra.geometry.camera.Camera`."""

_HALF_WIDTH = 1.0
_HEIGHT = 1.59
_LIGHT_HALF_WIDTH = 0.24
_LIGHT_GAP = 0.01  # below the ceiling, far enough that no ray sees both equally deep
_BOX_CENTRE = (0.38, 0.32)  # x, z
_BOX_SIZE = (0.56, 0.6, 0.56)
_BOX_TURN_DEGREES = 17.0
_SPHERE_CENTRE_XZ = (-0.42, -0.28)
_SPHERE_RADIUS = 0.4
_SPHERE_SEGMENTS = 32
_SPHERE_RINGS = 18

_Part = tuple[NDArray[np.float64], NDArray[np.int64]]


def cornell_box() -> Mesh:
    """The room: 12 triangles of walls and light, 12 of a box, 1,088 of a sphere. y is up, the +z side is open.

    Triangles wind so that their normals point into the room (walls, light) or outwards (box, sphere).
    """
    sphere_centre = (_SPHERE_CENTRE_XZ[0], _SPHERE_RADIUS, _SPHERE_CENTRE_XZ[1])
    parts = [*_room(), _box(), _sphere(sphere_centre, _SPHERE_RADIUS, _SPHERE_SEGMENTS, _SPHERE_RINGS)]
    first_vertex = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, first_vertex, strict=True)])
    return Mesh(vertices, faces, name="cornell_box")


def _room() -> list[_Part]:
    w, h = _HALF_WIDTH, _HEIGHT
    light, light_y = _LIGHT_HALF_WIDTH, _HEIGHT - _LIGHT_GAP
    return [
        _quad((-w, 0, w), (w, 0, w), (w, 0, -w), (-w, 0, -w)),  # floor
        _quad((-w, h, -w), (w, h, -w), (w, h, w), (-w, h, w)),  # ceiling
        _quad((-w, 0, -w), (w, 0, -w), (w, h, -w), (-w, h, -w)),  # back
        _quad((-w, 0, w), (-w, 0, -w), (-w, h, -w), (-w, h, w)),  # left
        _quad((w, 0, -w), (w, 0, w), (w, h, w), (w, h, -w)),  # right
        _quad((-light, light_y, -light), (light, light_y, -light), (light, light_y, light), (-light, light_y, light)),
    ]


def _quad(*corners: tuple[float, float, float]) -> _Part:
    return np.array(corners, np.float64), np.array([[0, 1, 2], [0, 2, 3]])


def _box() -> _Part:
    sx, sy, sz = _BOX_SIZE
    # Corner number is 4 z + 2 y + x in bits.
    bits = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)], np.float64)
    local = (bits - (0.5, 0.0, 0.5)) * (sx, sy, sz)
    c, s = cos(radians(_BOX_TURN_DEGREES)), sin(radians(_BOX_TURN_DEGREES))
    turned = local @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
    quads = [(4, 5, 7, 6), (1, 0, 2, 3), (5, 1, 3, 7), (0, 4, 6, 2), (6, 7, 3, 2), (0, 1, 5, 4)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return np.add(turned, (_BOX_CENTRE[0], 0.0, _BOX_CENTRE[1])), np.array(faces)


def _sphere(centre: tuple[float, float, float], radius: float, segments: int, rings: int) -> _Part:
    """A sphere of latitude and longitude: segments * (2 * rings - 2) triangles, one vertex at each pole."""
    polar = np.arange(1, rings) * (pi / rings)
    turn = np.arange(segments) * (2.0 * pi / segments)
    circles = np.stack(
        np.broadcast_arrays(
            np.sin(polar)[:, None] * np.sin(turn), np.cos(polar)[:, None], np.sin(polar)[:, None] * np.cos(turn)
        ),
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[(0.0, 1.0, 0.0)], circles, [(0.0, -1.0, 0.0)]]) * radius + centre
    faces = []
    south = len(vertices) - 1
    for i in range(segments):
        j = (i + 1) % segments
        faces.append((0, 1 + i, 1 + j))
        for ring in range(rings - 2):
            upper, lower = 1 + ring * segments, 1 + (ring + 1) * segments
            faces.append((upper + i, lower + i, lower + j))
            faces.append((upper + i, lower + j, upper + j))
        last = 1 + (rings - 2) * segments
        faces.append((last + i, south, last + j))
    return vertices, np.array(faces)
