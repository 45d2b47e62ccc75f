"""Ray space: where rays and triangles become float32. The eye is its origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.camera import Camera

NARROWEST_WORLD_PITCH = 2e-4
"""Pixel pitch down to which ray space has the world's axes, in which boxes fit walls and floors; below, the camera's.

Float32 in the world's axes moves a ray by some 1e-7 of the distance, whatever the pitch: a thousandth of a pixel here,
half a pixel at a hundredth of a degree. In the camera's axes the components across the view are small numbers, exact to
1e-7 of themselves. docs/departures.md has measurements of both.
"""


def ray_axes(camera: Camera) -> NDArray[np.float64]:
    """(3, 3) float64, rows right, down, forward of the camera in ray space; orthonormal."""
    return camera.axes if camera.pixel_pitch >= NARROWEST_WORLD_PITCH else np.eye(3)


def from_eye_space(camera: Camera, points_eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Eye space (N, 3) -> ray space (N, 3), float64."""
    return points_eye if camera.pixel_pitch >= NARROWEST_WORLD_PITCH else points_eye @ camera.axes.T


def to_ray_space(camera: Camera, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """World points (N, 3) -> ray space (N, 3), float64."""
    return from_eye_space(camera, camera.to_eye_space(points))
