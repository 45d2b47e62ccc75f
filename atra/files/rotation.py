"""Rotations from quaternions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rotation_of_quaternion(w: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    """The rotation (3, 3) float64 of a quaternion of length 1."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
