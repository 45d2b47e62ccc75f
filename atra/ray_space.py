"""Ray space: where rays and triangles become float32. The eye is its origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.view import View

NARROWEST_WORLD_PITCH = 2e-4
"""Pixel pitch down to which ray space has the world's axes, in which boxes fit walls and floors; below, the camera's.

Float32 in the world's axes moves a ray by some 1e-7 of the distance, whatever the pitch: a thousandth of a pixel here,
half a pixel at a hundredth of a degree. In the camera's axes the components across the view are small numbers, exact to
1e-7 of themselves. docs/departures.md has measurements of both. Where rays are parallel, the pitch is a length and says
nothing of this; ray space then has the world's axes.
"""


def ray_axes(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, rows right, down, forward of the camera in ray space; orthonormal."""
    return camera.axes if _has_world_axes(camera) else np.eye(3)


def from_eye_space(camera: View) -> NDArray[np.float64]:
    """(3, 3) float64, the rotation of eye space (the world's axes) to ray space."""
    return np.eye(3) if _has_world_axes(camera) else camera.axes


def to_ray_space(camera: View, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """World points (N, 3) -> ray space (N, 3), float64."""
    points_eye = camera.to_eye_space(points)
    return points_eye if _has_world_axes(camera) else points_eye @ camera.axes.T


def _has_world_axes(camera: View) -> bool:
    return camera.is_parallel or camera.pixel_pitch >= NARROWEST_WORLD_PITCH
