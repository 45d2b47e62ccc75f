"""A material ball made of numbers: a stand-in of 61,600 triangles for the paper's Mitsuba scene."""

from __future__ import annotations

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera
from scenes.shapes import Floats, Part, ball, join, lathe, ring, smooth_profile, surface

MATERIAL_BALL_CAMERA = upright_camera((0.0, 3.0, 6.0), (0.0, 1.06, 0.0), 26.0)
"""From the front and above."""

_BALL_HEIGHT = 1.28
_SHELL_RADIUS = 0.9
_SHELL_THICKNESS = 0.1
_OPENING_DEGREES = 42.0  # half the angle of the hole in the shell


def material_ball() -> Mesh:
    """A hollow ball with a round opening, a core inside it, on a turned stand before a curved backdrop.

    61,600 triangles: backdrop 512, shell 31,680, core 12,096, stand 10,112, ring 7,200. y is up.
    Depth complexity from its own camera, square image: a ray of a 32 x 32 grid crosses 2.5 triangles on average
    (the paper's scene, in our estimate of its view: 2.8).
    """
    shell = lathe(_shell_profile(), 160).turned(-28.0, lean=58.0).moved(y=_BALL_HEIGHT)
    core = ball(0.52, 96, 64).moved(y=_BALL_HEIGHT)
    return join(
        [_backdrop(), shell, core, lathe(_stand_profile(), 128), ring(0.74, 0.05, 60, 60).moved(y=0.44)]
    ).to_mesh("material_ball")


def _shell_profile() -> Floats:
    """From the outer pole opposite the opening, round the lip, to the inner pole."""
    angle = np.radians(180.0 - np.linspace(0.0, 180.0 - _OPENING_DEGREES, 47))
    outer = np.stack([np.sin(angle), np.cos(angle)], 1)
    inner = outer[::-1] * (_SHELL_RADIUS - _SHELL_THICKNESS)
    lip_angle = np.linspace(0.0, np.pi, 9)[1:-1]
    middle = outer[-1] * (_SHELL_RADIUS - _SHELL_THICKNESS / 2)
    along = np.array([outer[-1, 1], -outer[-1, 0]])  # the direction in which the shell would go on
    half = _SHELL_THICKNESS / 2
    lip = middle + half * (np.cos(lip_angle)[:, None] * outer[-1] - np.sin(lip_angle)[:, None] * along)
    return np.concatenate([outer * _SHELL_RADIUS, lip, inner])


def _stand_profile() -> Floats:
    knots = [(1.15, 0), (1.15, 0.1), (1.02, 0.16), (0.98, 0.3), (0.7, 0.38), (0.52, 0.5), (0.5, 0.62), (0.0, 0.42)]
    return smooth_profile(knots, 41)


def _backdrop() -> Part:
    """Floor, quarter round and wall in one sheet of 16 x 16 squares."""
    floor_z, wall_z, bend, squares = 7.0, -5.0, 2.5, 16
    turn = np.linspace(0.0, np.pi / 2, 8)
    z = np.concatenate([np.linspace(floor_z, wall_z + bend, 5)[:-1], wall_z + bend - bend * np.sin(turn), [wall_z] * 5])
    y = np.concatenate([np.zeros(4), bend - bend * np.cos(turn), np.linspace(bend, 8.0, 6)[1:]])
    x = np.linspace(-7.0, 7.0, squares + 1)
    return surface(np.stack(np.broadcast_arrays(x[:, None], y, z), -1))
