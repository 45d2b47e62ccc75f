"""The image plane: the grid of a view's pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite, pi
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.numbers import as_number, checked_positive
from atra.whole_numbers import is_whole_number

FARTHEST_AXIS_PIXELS = 1e6
"""Largest distance of the principal point from the image, beyond which float32 cannot tell rays apart."""


@dataclass(frozen=True)
class ImagePlane:
    """The grid of pixels on the image plane.

    Sub-pixel position (ox, oy) of pixel (x, y) lies, right of the view axis and below it, at

        (left + x + ox - axis_x) pitch_x,    (top + y + oy - axis_y) pitch_y

    Parameters
    ----------
    pitch_x, pitch_y : float
        Distance between neighbouring columns, and rows; for a pinhole camera 1 / focal length in pixels.
    axis_x, axis_y : float
        Column and row of the principal point, pixels; 0 is the left border of column 0, 0.5 its middle.
    left, top : int
        First column and row of the image; only these differ in a crop, whose rays stay the same.

    Raises
    ------
    InputError
        For a pitch not finite or not above 0, an axis not finite, and a left or top that is not whole.
    """

    pitch_x: float
    pitch_y: float
    axis_x: float
    axis_y: float
    left: int = 0
    top: int = 0

    def __post_init__(self) -> None:
        for name in ("pitch_x", "pitch_y"):
            object.__setattr__(self, name, checked_positive(name, getattr(self, name), "distance"))
        for name in ("left", "top"):
            if not is_whole_number(getattr(self, name)):
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a whole number of pixels")
            object.__setattr__(self, name, int(getattr(self, name)))
        for name in ("axis_x", "axis_y"):
            axis = as_number(getattr(self, name))
            if not isfinite(axis):
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a finite number of pixels")
            object.__setattr__(self, name, axis)

    @classmethod
    def centred(cls, pitch: float, width: int, height: int) -> Self:
        """Square pixels, with the principal point in the middle of a width x height image."""
        return cls(pitch, pitch, width / 2, height / 2)

    @classmethod
    def panoramic(cls, width: float, height: float) -> Self:
        """The grid of a panorama of width x height pixels, whose pitches are angles in radians."""
        return cls(2.0 * pi / width, pi / height, width / 2, height / 2)

    @property
    def axis_in_image(self) -> tuple[float, float]:
        """The principal point, in pixels from the image's upper left corner."""
        return self.axis_x - self.left, self.axis_y - self.top

    def cropped(self, pixels: tuple[int, int], corner: tuple[int, int], size: tuple[int, int]) -> Self:
        """The grid of a part of an image of `pixels`, width and height, from `corner` on. Raises InputError for a part
        that is not inside."""
        for name, start, count, most in zip(("left", "top"), corner, size, pixels, strict=True):
            if not (is_whole_number(start) and is_whole_number(count) and start >= 0 and count >= 1):
                raise InputError(f"{name} is {start!r} and the size {count!r}, expected whole numbers of pixels")
            if start + count > most:
                raise InputError(f"{name} {start} and {count} pixels reach beyond the {most} of the image")
        return replace(self, left=self.left + int(corner[0]), top=self.top + int(corner[1]))

    def columns(self, x: ArrayLike, offset: float = 0.0) -> NDArray[np.float64]:
        """Distances of columns `x`, at sub-pixel `offset`, right of the view axis, in pixels, float64."""
        return np.asarray(x, np.float64) + self.left - self.axis_x + offset

    def rows(self, y: ArrayLike, offset: float = 0.0) -> NDArray[np.float64]:
        """Distances of rows `y`, at sub-pixel `offset`, below the view axis, in pixels, float64."""
        return np.asarray(y, np.float64) + self.top - self.axis_y + offset


def check_axis(plane: ImagePlane, width: int, height: int) -> None:
    """Raise InputError for a principal point too far outside of an image of this size."""
    for name, axis, pixels in zip("xy", plane.axis_in_image, (width, height), strict=True):
        if max(-axis, axis - pixels) > FARTHEST_AXIS_PIXELS:
            raise InputError(
                f"the view axis meets the image plane at {name} = {axis:g} pixels, expected at most "
                f"{FARTHEST_AXIS_PIXELS:g} outside of the image: beyond, float32 cannot tell rays apart"
            )
