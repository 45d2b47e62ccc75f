"""The alignment of the paper: an image split into cells, and one shear per cell (paper §3.1-3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.camera import Camera
from atra.errors import InputError


@dataclass(frozen=True)
class Split:
    """nx x ny equal cells of a width x height image; cell (i, j) is column i, row j.

    Raises InputError for counts below 1 and for counts that do not divide the image.
    """

    nx: int
    ny: int
    width: int
    height: int

    def __post_init__(self) -> None:
        for name, count in (("columns", self.nx), ("rows", self.ny)):
            if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
                raise InputError(f"split ({self.nx}, {self.ny}): the number of {name} must be a whole number >= 1")
        if self.width % self.nx or self.height % self.ny:
            raise InputError(
                f"split ({self.nx}, {self.ny}) does not divide image {self.width} x {self.height}; "
                f"split_x must divide {self.width} and split_y must divide {self.height}"
            )

    @property
    def cell_count(self) -> int:
        return self.nx * self.ny

    @property
    def cell_width(self) -> int:
        """Pixels."""
        return self.width // self.nx

    @property
    def cell_height(self) -> int:
        """Pixels."""
        return self.height // self.ny


@dataclass(frozen=True)
class Alignment:
    """Where the reference rays lie, and the shear that carries each cell's rays onto them.

    The shear of cell (i, j), in camera space, is

        X' = X - shift_x[i] Z,    Y' = Y - shift_y[j] Z,    Z' = Z

    It is linear, fixes the eye, maps the rays of the cell one-to-one onto the reference rays and keeps the ray
    parameter, which is the depth. The paper takes cell (0, 0)'s own rays as the reference (`shift = i w`, paper §3.1).
    Any other translate of them satisfies the condition of paper §3.3 just as well; where the reference lies changes
    how well boxes along the world's axes fit its rays (`at_quarter`; docs/departures.md has the figures).

    shift_x: (nx,) float64, shift_y: (ny,) float64: shifts on the image plane Z = 1.
    first_x_pixels, first_y_pixels: left and top border of the reference cell on the image plane, in pixels from the
    view axis.
    """

    split: Split
    first_x_pixels: float
    first_y_pixels: float
    shift_x: NDArray[np.float64]
    shift_y: NDArray[np.float64]

    @classmethod
    def at_quarter(cls, camera: Camera, split: Split) -> Alignment:
        """Reference rays start a quarter of the image from its centre, away from the world axis nearest the view.

        Nearer the border the frustum is more slanted, and boxes fit it less well. Nearer to where a component of the
        direction vanishes, the reciprocals in a packet, which Embree tests boxes with, lie far apart. An image axis
        that is not split stays as it is.
        """
        right, down, forward = camera.axes
        nearest = np.argmax(np.abs(forward))
        first_x_pixels, first_y_pixels = -camera.width / 2, -camera.height / 2
        if split.nx > 1:
            side = -1 if right[nearest] * forward[nearest] >= 0 else 1
            first_x_pixels = side * camera.width / 4
        if split.ny > 1:
            side = -1 if down[nearest] * forward[nearest] >= 0 else 1
            first_y_pixels = side * camera.height / 4
        return cls._at(camera, split, first_x_pixels, first_y_pixels)

    @classmethod
    def at_first_cell(cls, camera: Camera, split: Split) -> Alignment:
        """Reference rays are those of cell (0, 0), as the paper has it."""
        return cls._at(camera, split, -camera.width / 2, -camera.height / 2)

    @classmethod
    def _at(cls, camera: Camera, split: Split, first_x_pixels: float, first_y_pixels: float) -> Alignment:
        pitch = camera.pixel_pitch
        shift_x = np.arange(split.nx) * split.cell_width - camera.width / 2 - first_x_pixels
        shift_y = np.arange(split.ny) * split.cell_height - camera.height / 2 - first_y_pixels
        shifts = ((shift * pitch).astype(np.float64) for shift in (shift_x, shift_y))
        return cls(split, first_x_pixels, first_y_pixels, *shifts)

    def shear_points(self, points_camera: NDArray[np.floating], i: int, j: int) -> NDArray[np.float64]:
        """Camera-space points (N, 3) -> the same points in the reference rays' space of cell (i, j), float64."""
        sheared = np.array(points_camera, np.float64)
        sheared[:, 0] -= self.shift_x[i] * sheared[:, 2]
        sheared[:, 1] -= self.shift_y[j] * sheared[:, 2]
        return sheared
