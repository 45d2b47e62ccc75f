"""A Cornell box made of numbers: the 1,112 triangles of the paper's smallest scene, with no file.

The paper gives the triangle count but not the geometry, so the design is ours: an open room with a ceiling light, one
turned box and one sphere. Two more layouts have as many, but on the walls, or on two boxes.
"""

from __future__ import annotations

from math import pi

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera
from scenes.shapes import Part, box, join, quad, surface

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


_WALL_CELLS = ((12, 11), (12, 11), (9, 7), (12, 9), (12, 9))
_TALL_HEIGHT = 1.1
_BOX_CELLS = ((5, 7, 5), (6, 12, 6))


def cornell_box_walls() -> Mesh:
    """As many triangles, on walls: 1,086 of five walls in grids, 2 of the light, 12 of each of two boxes."""
    return join([*_room(_WALL_CELLS), *_boxes(((1, 1, 1), (1, 1, 1)))]).to_mesh("cornell_box_walls")


def cornell_box_boxes() -> Mesh:
    """As many triangles, on boxes: 12 of walls and light, 1,100 of the faces of a low and a tall box in grids."""
    return join([*_room(), *_boxes(_BOX_CELLS)]).to_mesh("cornell_box_boxes")


def _room(cells: tuple[tuple[int, int], ...] = ((1, 1),) * 5) -> list[Part]:
    """cells: of the grids of floor, ceiling, back, left and right wall."""
    w, h = _HALF_WIDTH, _HEIGHT
    light, light_y = _LIGHT_HALF_WIDTH, _HEIGHT - _LIGHT_GAP
    walls = (
        ((-w, 0, w), (w, 0, w), (w, 0, -w), (-w, 0, -w)),  # floor
        ((-w, h, -w), (w, h, -w), (w, h, w), (-w, h, w)),  # ceiling
        ((-w, 0, -w), (w, 0, -w), (w, h, -w), (-w, h, -w)),  # back
        ((-w, 0, w), (-w, 0, -w), (-w, h, -w), (-w, h, w)),  # left
        ((w, 0, -w), (w, 0, w), (w, h, w), (w, h, -w)),  # right
    )
    return [
        *(_grid(wall, *of_wall) for wall, of_wall in zip(walls, cells, strict=True)),
        quad((-light, light_y, -light), (light, light_y, -light), (light, light_y, light), (-light, light_y, light)),
    ]


def _grid(corners: tuple[tuple[float, float, float], ...], across: int, down: int) -> Part:
    """The quad of these corners, given in order around the edge, in cells along its first edge and its second."""
    if (across, down) == (1, 1):
        return quad(*corners)
    a, b, c, d = np.array(corners, np.float64)
    s, t = np.linspace(0.0, 1.0, across + 1)[:, None], np.linspace(0.0, 1.0, down + 1)[:, None, None]
    return surface((1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c))


def _boxes(cells: tuple[tuple[int, int, int], ...]) -> list[Part]:
    """A low box in front and a tall one behind it. cells: along x, y and z of each box's faces."""
    x, height, z = _BOX_SIZE
    low, tall = (_box_in_cells(x, y, z, one) for y, one in zip((height, _TALL_HEIGHT), cells, strict=True))
    return [
        low.turned(_BOX_TURN_DEGREES).moved(_BOX_CENTRE[0], 0.0, _BOX_CENTRE[1]),
        tall.turned(-_BOX_TURN_DEGREES).moved(_SPHERE_CENTRE_XZ[0], 0.0, _SPHERE_CENTRE_XZ[1]),
    ]


def _box_in_cells(x: float, y: float, z: float, cells: tuple[int, int, int]) -> Part:
    """A box as of `scenes.shapes.box`, its faces in grids of so many cells along x, y and z."""
    plain = box(x, y, z)
    faces = []
    for face in range(0, len(plain.faces), 2):
        (a, b, c), (_, _, d) = plain.faces[face : face + 2]
        corners = plain.vertices[[a, b, c, d]]
        along = [int(np.argmax(np.abs(corners[k] - corners[0]))) for k in (1, 3)]
        faces.append(_grid(tuple(map(tuple, corners)), cells[along[0]], cells[along[1]]))
    return join(faces)


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
