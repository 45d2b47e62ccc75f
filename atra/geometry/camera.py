"""Pinhole camera: pixel -> ray."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import radians, tan
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import Vector, View, as_number, check_offset

__all__ = ["Camera", "Vector", "check_offset"]


@dataclass(frozen=True)
class Camera(View):
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

    is_parallel: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        fov = as_number(self.fov_y_degrees)
        if not 0.0 < fov < 180.0:
            raise InputError(f"fov_y_degrees is {self.fov_y_degrees!r}, expected an angle between 0 and 180 degrees")
        object.__setattr__(self, "fov_y_degrees", fov)

    @cached_property
    def pixel_pitch(self) -> float:
        """Distance between neighbouring pixels on the image plane Z = 1."""
        return 2.0 * tan(radians(self.fov_y_degrees) / 2.0) / self.height

    @cached_property
    def to_pixels(self) -> NDArray[np.float64]:
        """(3, 4) float64: eye-space point (X, Y, Z, 1) -> (a, b, c), pixel position (a / c, b / c) and depth c."""
        right, down, forward = self.axes
        rows = np.stack(
            [
                right / self.pixel_pitch + self.width / 2 * forward,
                down / self.pixel_pitch + self.height / 2 * forward,
                forward,
            ]
        )
        return np.column_stack([rows, np.zeros(3)])

    def rays(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        directions = self.directions(x, y, offset)
        return np.zeros_like(directions), directions

    def directions(
        self, x: NDArray[np.integer], y: NDArray[np.integer], offset: tuple[float, float] = (0.5, 0.5)
    ) -> NDArray[np.float64]:
        """Camera-space directions (..., 3) float64, unit Z, of pixels (x, y) at sub-pixel `offset`."""
        return self._on_image_plane(x, y, offset, 1.0)
