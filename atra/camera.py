"""Pinhole camera: pixel -> ray."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite, radians, tan

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError

Vector = tuple[float, float, float]

# sin of the angle below which `up` counts as parallel to the view direction; float64 leaves ten digits above it.
_PARALLEL_SINE = 1e-6


@dataclass(frozen=True)
class Camera:
    """A pinhole camera and its pixel grid.

    Camera space has the eye at the origin, X to the right (forward x up), Y down (down = forward x right) and Z along
    the view axis; the image plane lies at Z = 1. The ray of pixel (x, y) at sub-pixel `offset` (ox, oy) has direction
    ((x + ox - W/2) p, (y + oy - H/2) p, 1) with pixel pitch p = 2 tan(fov_y / 2) / H, so a ray parameter *is* a depth
    along the view axis.

    eye, target, up: three finite floats each, scene units.
    fov_y_degrees: full vertical field of view, in (0, 180).
    width, height: image size in pixels, at least 1.

    Raises InputError for a size below 1, a field of view outside (0, 180), eye = target, or up parallel to the view.
    Source: paper §3.1; the axes are ours (the paper leaves them open).
    """

    eye: Vector
    target: Vector
    up: Vector = (0.0, 1.0, 0.0)
    fov_y_degrees: float = 60.0
    width: int = 1024
    height: int = 1024

    _axes: NDArray[np.float64] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("eye", "target", "up"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        for name in ("width", "height"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
                raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
            object.__setattr__(self, name, int(value))
        fov = float(self.fov_y_degrees)
        if not (isfinite(fov) and 0.0 < fov < 180.0):
            raise InputError(f"fov_y_degrees is {self.fov_y_degrees!r}, expected an angle between 0 and 180 degrees")
        object.__setattr__(self, "fov_y_degrees", fov)
        object.__setattr__(self, "_axes", self._compute_axes())

    def _compute_axes(self) -> NDArray[np.float64]:
        view = np.subtract(self.target, self.eye)
        distance = np.linalg.norm(view)
        if not (np.isfinite(distance) and distance > 0.0):
            raise InputError(f"eye and target are both {self.eye}, expected two different points")
        forward = view / distance
        up_length = np.linalg.norm(self.up)
        if not up_length > 0.0:
            raise InputError(f"up is {self.up}, expected a direction of non-zero length")
        right = np.cross(forward, np.asarray(self.up) / up_length)
        sine = np.linalg.norm(right)
        if sine < _PARALLEL_SINE:
            raise InputError(f"up {self.up} is parallel to the view direction {tuple(forward.tolist())}; tilt it")
        right /= sine
        return np.stack([right, np.cross(forward, right), forward])

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) float64, rows right, down, forward in world space; orthonormal."""
        return self._axes

    @cached_property
    def pixel_pitch(self) -> float:
        """Distance between neighbouring pixels on the image plane Z = 1."""
        return 2.0 * tan(radians(self.fov_y_degrees) / 2.0) / self.height

    def to_eye_space(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """World points (N, 3) -> eye space (N, 3) float64: the world's axes, the eye at the origin."""
        return np.asarray(points, np.float64) - self.eye

    def to_camera_space(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """World points (N, 3) -> camera space (N, 3) float64, subtracting the eye before rotating to keep digits."""
        return self.to_eye_space(points) @ self.axes.T

    def directions(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> NDArray[np.float64]:
        """Camera-space directions (..., 3) float64, unit Z, of pixels (x, y) at sub-pixel `offset`."""
        check_offset(offset)
        direction_x = (np.asarray(x) + (offset[0] - self.width / 2)) * self.pixel_pitch
        direction_y = (np.asarray(y) + (offset[1] - self.height / 2)) * self.pixel_pitch
        return np.stack(np.broadcast_arrays(direction_x, direction_y, 1.0), axis=-1)


def check_offset(offset: tuple[float, float]) -> None:
    """Raise InputError unless `offset` is a sub-pixel position in [0, 1) x [0, 1)."""
    ok = len(offset) == 2 and all(isfinite(o) and 0.0 <= o < 1.0 for o in offset)
    if not ok:
        raise InputError(f"offset is {offset!r}, expected two numbers in [0, 1), such as (0.5, 0.5) for pixel centres")


def _vector(name: str, value: object) -> Vector:
    try:
        x, y, z = (float(v) for v in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"{name} is {value!r}, expected three numbers") from None
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise InputError(f"{name} is {(x, y, z)}, expected finite numbers")
    return x, y, z
