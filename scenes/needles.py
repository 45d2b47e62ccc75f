"""Needles: a floor of planks and beams around the eye, long and thin, on which float32 is at its worst."""

from __future__ import annotations

from typing import Any

import numpy as np

from atra.geometry.mesh import Mesh

PLANKS, BEAMS = 80, 400
PLANK_LENGTH, PLANK_WIDTH, FLOOR = 100.0, 0.05, -0.3

NEEDLES_CAMERA: dict[str, Any] = {
    "eye": [0.0, 0.0, 0.0],
    "target": [0.0, -0.2, -1.0],
    "up": [0.0, 1.0, 0.0],
    "fov_y_degrees": 60.0,
}
"""Among the beams, looking along the planks and a little down."""


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
