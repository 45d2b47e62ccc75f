"""Culling for lenses: the clusters that the cone of a tile's rays may meet, and where in the tile they are seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.compiled.memory import doubles_at
from atra.compiled.store import njit
from atra.raster.culling import NEARER, ROUNDINGS, extent, pixels_met

_SLACK = 1e-7
"""Widening of a cluster's ball, as a share of its distance: rounding of squared distances moves it by less."""

_NEARER_OF_BALL = 2.0**-14
"""Share by which the bound of nearness by a cluster's distance is widened. Of triangles that reach behind the eye no
corner limits what rounding makes of their planes."""


def balls_of(boxes: NDArray[np.float32], eye: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Balls around clusters, the nearest first: (C, 5) float64, centre seen from the eye, its squared distance, radius;
    and (C,) int64, which cluster each is of."""
    low, high = boxes[:, :3].astype(np.float64), boxes[:, 3:].astype(np.float64)
    centres = 0.5 * (low + high) - eye
    squared = (centres**2).sum(axis=1)
    distances, radii = np.sqrt(squared), 0.5 * np.sqrt(((high - low) ** 2).sum(axis=1))
    balls = np.column_stack([centres, squared, radii * (1.0 + _SLACK) + distances * _SLACK])
    order = np.argsort(distances - radii, kind="stable")
    return balls[order], order


@njit(forceinline=True)
def meets(balls, place, cones, number):  # type: ignore[no-untyped-def]
    """Whether a ball may meet a cone: its centre is nearer to the cone's surface than its radius, or inside."""
    along = balls[place, 0] * cones[number, 0] + balls[place, 1] * cones[number, 1] + balls[place, 2] * cones[number, 2]
    reach = balls[place, 4] + along * cones[number, 4]
    cosine = cones[number, 3]
    return reach >= 0.0 and (balls[place, 3] - along * along) * cosine * cosine <= reach * reach


@njit
def place_cluster(boxes, cluster, eye, side, margin, cosine):  # type: ignore[no-untyped-def]
    """First and last column, first and last row of the tile that may show something of a cluster, the last before the
    first where none may; and nearness that nothing in it exceeds.

    cosine: of the cone around the tile's rays. A hit is as far from the eye as the box, and at least `cosine` times
    that from the eye plane, behind which the box may reach.
    """
    m, d, position = doubles_at(eye.to_pixels), doubles_at(eye.depth_axis), doubles_at(eye.position)
    box = (
        boxes[cluster, 0] - position[0],
        boxes[cluster, 1] - position[1],
        boxes[cluster, 2] - position[2],
        boxes[cluster, 3] - position[0],
        boxes[cluster, 4] - position[1],
        boxes[cluster, 5] - position[2],
    )
    x, y, z = max(box[0], -box[3], 0.0), max(box[1], -box[4], 0.0), max(box[2], -box[5], 0.0)
    least = np.sqrt(x * x + y * y + z * z) * cosine
    bound = (1.0 + _NEARER_OF_BALL) / least if least > 0.0 else np.inf
    near, far, depth_size = extent(d[0], d[1], d[2], box)
    rounding = ROUNDINGS * depth_size + eye.least_depth
    near, far = near - rounding, far + rounding
    if far < 0.0:
        return 0, -1, 0, -1, np.float32(0.0)
    if near <= eye.least_depth:
        return 0, side - 1, 0, side - 1, np.float32(bound)
    left, right = pixels_met(m, 0, d, box, near, depth_size, margin, side - 1.0)
    top, bottom = pixels_met(m, 4, d, box, near, depth_size, margin, side - 1.0)
    if left <= right and top <= bottom:
        return int(left), int(right), int(top), int(bottom), np.float32(min((1.0 + NEARER) / near, bound))
    return 0, -1, 0, -1, np.float32(0.0)
