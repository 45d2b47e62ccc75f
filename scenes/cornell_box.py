"""A Cornell box made of numbers: the 1,112 triangles of the paper's smallest scene, with no file.

The paper gives the triangle count but not the geometry, so the design is ours: an open room with a ceiling light, one
turned box and one sphere.
"""

from __future__ import annotations

from math import pi

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera
from scenes.shapes import Part, box, join, quad

CORNELL_BOX_CAMERA = upright_camera((0.0, 0.8, 2.3), (0.0, 0.8, -1.0), 45.0)
"""Looks through the open side along -z."""

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


def cornell_box() -> Mesh:
    """The room: 12 triangles of walls and light, 12 of a box, 1,088 of a sphere. y is up, the +z side is open.

    Triangles wind so that their normals point into the room (walls, light) or outwards (box, sphere).
    """
    turned_box = box(*_BOX_SIZE).turned(_BOX_TURN_DEGREES).moved(_BOX_CENTRE[0], 0.0, _BOX_CENTRE[1])
    sphere = _sphere(_SPHERE_RADIUS, _SPHERE_SEGMENTS, _SPHERE_RINGS)
    resting = sphere.moved(_SPHERE_CENTRE_XZ[0], _SPHERE_RADIUS, _SPHERE_CENTRE_XZ[1])
    return join([*_room(), turned_box, resting]).to_mesh("cornell_box")


def _room() -> list[Part]:
    w, h = _HALF_WIDTH, _HEIGHT
    light, light_y = _LIGHT_HALF_WIDTH, _HEIGHT - _LIGHT_GAP
    return [
        quad((-w, 0, w), (w, 0, w), (w, 0, -w), (-w, 0, -w)),  # floor
        quad((-w, h, -w), (w, h, -w), (w, h, w), (-w, h, w)),  # ceiling
        quad((-w, 0, -w), (w, 0, -w), (w, h, -w), (-w, h, -w)),  # back
        quad((-w, 0, w), (-w, 0, -w), (-w, h, -w), (-w, h, w)),  # left
        quad((w, 0, -w), (w, 0, w), (w, h, w), (w, h, -w)),  # right
        quad((-light, light_y, -light), (light, light_y, -light), (light, light_y, light), (-light, light_y, light)),
    ]


def _sphere(radius: float, segments: int, rings: int) -> Part:
    """A sphere of latitude and longitude: segments * (2 * rings - 2) triangles, one vertex at each pole."""
    polar = np.arange(1, rings) * (pi / rings)
    turn = np.arange(segments) * (2.0 * pi / segments)
    circles = np.stack(
        np.broadcast_arrays(
            np.sin(polar)[:, None] * np.sin(turn), np.cos(polar)[:, None], np.sin(polar)[:, None] * np.cos(turn)
        ),
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[(0.0, 1.0, 0.0)], circles, [(0.0, -1.0, 0.0)]]) * radius
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
    return Part(vertices, np.array(faces))
