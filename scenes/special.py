"""Special scenes: needles, a floor of planks and beams around the eye, long and thin, on which float32 is at its worst;
and three holes, a closed solid of genus 3, for what only meshes with an inside have, such as thickness."""

from __future__ import annotations

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import upright_camera

PLANKS, BEAMS = 80, 400
PLANK_LENGTH, PLANK_WIDTH, FLOOR = 100.0, 0.05, -0.3

NEEDLES_CAMERA = upright_camera((0.0, 0.0, 0.0), (0.0, -0.2, -1.0), 60.0)
"""Among the beams, looking along the planks and a little down."""

ACROSS = 27
"""Squares along the side of a block."""

THREE_HOLES_CAMERA = upright_camera((4.0, 3.5, 6.5), (0.0, 0.0, 0.0), 40.0)
"""From above and aside, so that some rays pass through the holes and others through several walls."""


def needles() -> Mesh:
    """80 planks side by side, 0.3 below the eye, and 400 beams of any direction, a third of them along an axis."""
    left = PLANK_WIDTH * (np.arange(PLANKS) - PLANKS / 2)
    near, far = np.full(PLANKS, PLANK_LENGTH / 2), np.full(PLANKS, -PLANK_LENGTH / 2)
    floor = np.full(PLANKS, FLOOR)
    corners = [(left, near), (left + PLANK_WIDTH, near), (left + PLANK_WIDTH, far), (left, far)]
    planks = np.stack([np.stack([x, floor, z], axis=1) for x, z in corners], axis=1)
    quads = 4 * np.arange(PLANKS)[:, None]
    plank_faces = np.concatenate([quads + [0, 1, 2], quads + [0, 2, 3]], axis=1).reshape(-1, 3)

    random = np.random.default_rng(2019)
    centre = random.normal(size=(BEAMS, 3)) * random.choice([0.5, 2.0, 8.0], (BEAMS, 1))
    along = random.normal(size=(BEAMS, 3))
    straight = random.random(BEAMS) < 1 / 3
    along[straight] = np.eye(3)[random.integers(0, 3, straight.sum())]
    along *= random.choice([3.0, 20.0, 100.0], (BEAMS, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    across = random.normal(size=(BEAMS, 3)) * random.choice([0.02, 0.1, 0.5], (BEAMS, 1))
    beams = np.stack([centre - along, centre + along, centre + across + random.random((BEAMS, 1)) * along], axis=1)
    beam_faces = 4 * PLANKS + np.arange(3 * BEAMS).reshape(-1, 3)
    return Mesh(
        np.concatenate([planks.reshape(-1, 3), beams.reshape(-1, 3)]),
        np.concatenate([plank_faces, beam_faces]),
        "needles",
    )


def three_holes(across: int = ACROSS) -> Mesh:
    """A bent plate of 7 x 3 x 1 blocks with three of them missing: 136 across^2 triangles, counterclockwise seen from
    outside."""
    solid = np.zeros((9, 5, 3), bool)
    solid[1:8, 1:4, 1] = True
    solid[[2, 4, 6], 2, 1] = False
    grid = np.arange(across)
    corners = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for way in (-1, 1):
            for block in np.argwhere(solid & ~np.roll(solid, -way, axis)):
                at = np.zeros((across, across, 4, 3), np.int64)
                at[..., axis] = (block[axis] + (way > 0)) * across
                steps = [(0, 0), (1, 0), (1, 1), (0, 1)]
                for corner, (du, dv) in enumerate(steps if way > 0 else steps[::-1]):
                    at[:, :, corner, u] = block[u] * across + grid[:, None] + du
                    at[:, :, corner, v] = block[v] * across + grid + dv
                corners.append(at.reshape(-1, 4, 3))
    places, numbers = np.unique(np.concatenate(corners).reshape(-1, 3), axis=0, return_inverse=True)
    quads = numbers.reshape(-1, 4)
    x, y, z = (places / across - (4.5, 2.5, 1.5)).T
    bent = np.stack([x, y + 0.3 * np.sin(x), z + 0.4 * np.cos(y + 0.5 * x)], axis=1)
    return Mesh(bent, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), "three_holes")
