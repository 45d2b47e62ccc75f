"""Framing: how far away a camera must be to see a whole box."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

MARGIN = 0.05
"""Share of the image that is left free on either side."""


def framing_distance(
    bounds: NDArray[np.floating], axes: NDArray[np.float64], fov_y_degrees: float, width: int, height: int
) -> float:
    """The least distance from a box's centre at which a pinhole camera with these axes sees all of the box.

    bounds: (2, 3), lowest and highest corner, scene units. axes: (3, 3), rows right, down, forward.
    """
    half = (np.asarray(bounds[1], np.float64) - bounds[0]) / 2.0
    x, y, z = (np.array(list(product((-1.0, 1.0), repeat=3))) * half @ axes.T).T
    reach_y = np.tan(np.radians(fov_y_degrees) / 2.0) * (1.0 - 2.0 * MARGIN)
    reach_x = reach_y * width / height
    distance = float((np.maximum(np.abs(x) / reach_x, np.abs(y) / reach_y) - z).max())
    return max(distance, float(np.linalg.norm(half)) * 1.001) or 1.0
